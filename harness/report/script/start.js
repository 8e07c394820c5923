addEventListener("DOMContentLoaded", () => {
  overview();
  copying();
  route().then(() => { page.dataset.ready = "yes"; });
  addEventListener("hashchange", route);
  document.addEventListener("click", (event) => {
    const link = event.target.closest("a[href^='#']");
    if (link && link.hash === location.hash) route();
  });
  // Paper can't be unfolded: what is text is shown, and folded again.
  const folded = [];
  addEventListener("beforeprint", () => {
    for (const each of document.querySelectorAll(".view.current details:is(.numbers, .more):not([open])")) {
      each.open = true;
      folded.push(each);
    }
  });
  addEventListener("afterprint", () => { for (const each of folded.splice(0)) each.open = false; });
  // Plots have the page's colours in them, light or dark.
  dark.addEventListener("change", () => {
    // Paper is light, and there is no time to draw again for it.
    if (matchMedia("print").matches) return;
    for (const element of document.querySelectorAll("figure[data-drawn]")) element.rest();
  });
});
