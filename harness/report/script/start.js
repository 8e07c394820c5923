addEventListener("DOMContentLoaded", () => {
  overview();
  copying();
  route();
  addEventListener("hashchange", route);
  document.addEventListener("click", (event) => {
    const link = event.target.closest("a[href^='#']");
    if (link && link.hash === location.hash) route();
  });
  // Plots have the page's colours in them, light or dark.
  dark.addEventListener("change", () => {
    // Paper is light, and there is no time to draw again for it.
    if (matchMedia("print").matches) return;
    for (const element of document.querySelectorAll("figure[data-drawn]")) element.rest();
  });
  page.dataset.ready = "yes";
});
