addEventListener("DOMContentLoaded", () => {
  overview();
  copying();
  route().then(() => { page.dataset.ready = "yes"; });
  addEventListener("hashchange", route);
  document.addEventListener("click", (event) => {
    const link = event.target.closest("a[href^='#']");
    if (link && link.hash === location.hash) route();
  });
  // For printing, unfold all texts, and fold them again afterwards.
  const folded = [];
  addEventListener("beforeprint", () => {
    for (const box of document.querySelectorAll(".view.current [data-pack]")) drawWaiting(box);
    for (const each of document.querySelectorAll(".view.current details.more:not([open])")) {
      each.open = true;
      folded.push(each);
    }
  });
  addEventListener("afterprint", () => { for (const each of folded.splice(0)) each.open = false; });
});
