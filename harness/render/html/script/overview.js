/** Make the list of cases sortable and filterable, and apply the filter to the matrix. */
function overview() {
  const table = document.getElementById("cases");
  if (!table) return;
  const body = table.tBodies[0];
  const rows = [...body.rows].map((row, place) => ({ row, place, text: row.textContent.toLowerCase() }));
  const byRow = new Map(rows.map((each) => [each.row, each]));
  const field = (id) => document.getElementById(id);
  const choices = ["outcome", "system", "engine"].map((name) => [name, field(`filter-${name}`)]);
  const search = field("search"), matching = field("matching"), all = field("all");
  const first = Number(table.dataset.most); // the page contains the other rows hidden
  let most = first;

  function filter() {
    const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    let count = 0;
    for (const each of rows) {
      const chosen = choices.every(([name, choice]) => !choice.value || each.row.dataset[name] === choice.value);
      each.chosen = chosen && words.every((word) => each.text.includes(word));
      count += each.chosen;
    }
    limit(count);
    const total = rows.length === 1 ? "1 case" : `${rows.length} cases`;
    matching.textContent = count === rows.length ? total : `${count} of ${total}`;
    const cells = new Set(rows.filter((each) => each.chosen).map((each) => `${each.row.dataset.system} ${each.row.dataset.model} ${each.row.dataset.engine}`));
    for (const cell of document.querySelectorAll(".matrix .cell[data-cell]")) {
      cell.classList.toggle("faded", !cells.has(cell.dataset.cell));
    }
  }

  /** Show a number of the selected rows: laying out ten thousand takes seconds. */
  function limit(count) {
    let left = most;
    for (const row of [...body.rows]) row.hidden = !byRow.get(row).chosen || left-- <= 0;
    all.hidden = count <= most;
    all.textContent = `Show all ${count}, not ${first}`;
  }

  function sort(head, place) {
    const up = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
    for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", up === 1 ? "ascending" : "descending");
    const value = ({ row }) => {
      const cell = row.cells[place];
      if (cell.dataset.v === undefined) return cell.textContent.trim();
      return cell.dataset.v === "" ? NaN : Number(cell.dataset.v);
    };
    const keyed = rows.map((each) => ({ ...each, key: value(each) }));
    // Missing values are last in both orders.
    keyed.sort((a, b) => {
      const [m, n] = [Number.isNaN(a.key), Number.isNaN(b.key)];
      if (m || n) return m - n || a.place - b.place;
      const order = typeof a.key === "string" ? a.key.localeCompare(b.key) : a.key - b.key;
      return up * order || a.place - b.place;
    });
    body.replaceChildren(); // moving 10 000 rows one by one takes 20 seconds
    body.append(...keyed.map((each) => each.row));
    limit(rows.filter((each) => each.chosen).length);
  }

  [...table.tHead.rows[0].cells].forEach((head, place) => {
    if (!head.dataset.kind) return;
    const button = make("button", { type: "button" }, ...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => sort(head, place));
  });
  for (const [, choice] of choices) choice.addEventListener("change", filter);
  search.addEventListener("input", filter);
  all.addEventListener("click", () => {
    most = Infinity;
    filter();
  });
  field("clear").addEventListener("click", () => {
    search.value = "";
    for (const [, choice] of choices) choice.value = "";
    filter();
  });
  filter();
}
