/** Name of the tab that was chosen last; the next case opens with it. */
let chosenTab = "";
let tabCount = 0;

/** Turn parts of a page, with their names in `data-tab`, into tabs before a place.
 *
 * Arrow keys, Home and End choose. Print and pages without script show all parts. */
function tabs(place, panels, opened) {
  const list = make("div", { class: "tabs", role: "tablist", "aria-label": "Parts of the case" });
  const buttons = panels.map((panel) => {
    const id = `tab-${tabCount += 1}`;
    dressed(panel, { id: `${id}-panel`, role: "tabpanel", "aria-labelledby": id, tabindex: "0" });
    return make("button", { type: "button", role: "tab", id, "aria-controls": panel.id }, panel.dataset.tab);
  });
  const choose = (chosen) => {
    panels.forEach((panel, i) => {
      panel.classList.toggle("chosen", i === chosen);
      dressed(buttons[i], { "aria-selected": String(i === chosen), tabindex: i === chosen ? "0" : "-1" });
    });
    opened();
  };
  const ask = (chosen) => {
    chosenTab = panels[chosen].dataset.tab;
    choose(chosen);
    buttons[chosen].focus();
  };
  buttons.forEach((button, i) => button.addEventListener("click", () => ask(i)));
  list.addEventListener("keydown", ({ key }) => {
    const last = buttons.length - 1, at = buttons.indexOf(document.activeElement);
    const to = { ArrowRight: at === last ? 0 : at + 1, ArrowLeft: at ? at - 1 : last, Home: 0, End: last }[key];
    if (to !== undefined && at >= 0) ask(to);
  });
  list.append(...buttons);
  place.before(list);
  /** Open the tab that was chosen in another case, if this one has it. */
  list.recall = () => choose(Math.max(0, panels.findIndex((panel) => panel.dataset.tab === chosenTab)));
  list.recall();
}
