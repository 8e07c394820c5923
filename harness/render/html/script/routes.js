/** Return the target of the address; the overview if it has none. */
async function target() {
  const id = location.hash.slice(1);
  for (const name of [id, decoded(id)]) {
    if (!name) continue;
    if (away(name)) await part(name).catch((error) => missing(error.message));
    const found = document.getElementById(name);
    if (found) return found;
  }
  return document.getElementById("overview");
}

function decoded(id) {
  try {
    return decodeURIComponent(id);
  } catch {
    return "";
  }
}

/** Report on the overview what could not be loaded. */
function missing(what) {
  note("errors", what);
  const at = document.querySelector("#overview .verdict");
  if (!document.getElementById("missing")) at.after(make("p", { class: "note", id: "missing", role: "alert" }));
  document.getElementById("missing").textContent = `${what[0].toUpperCase()}${what.slice(1)}.`;
}

/** Show only the view that the address points to, and build its plots. */
async function route() {
  const asked = location.hash;
  const to = await target();
  if (location.hash !== asked) return; // the reader left before the file was loaded
  const view = to.closest(".view") ?? document.getElementById("overview");
  for (const other of document.querySelectorAll(".view.current")) {
    if (other === view) continue;
    other.classList.remove("current");
    for (const element of other.querySelectorAll("figure[data-drawn]")) element.rest();
    for (const box of other.querySelectorAll("[data-scene]")) endScene(box);
  }
  view.classList.add("current");
  if (view instanceof HTMLDetailsElement) {
    view.open = true;
    const summary = view.querySelector("summary");
    summary.tabIndex = -1; // folding it would leave an empty page
    summary.onclick = (event) => { if (!event.target.closest("a")) event.preventDefault(); };
  }
  const heading = view.querySelector("h1, h2, .name");
  document.title = `crosscheck: ${heading.textContent.trim()}`;
  if (to === view) scrollTo(0, 0); else to.scrollIntoView();
  opened(view);
}

function opened(view) {
  for (const box of view.querySelectorAll("[data-scene]")) buildScene(box);
  for (const box of view.querySelectorAll("[data-pack]")) {
    if (box.dataset.built) drawRest(box); else build(box);
  }
  for (const list of view.querySelectorAll("[role=tablist]")) list.recall();
}
