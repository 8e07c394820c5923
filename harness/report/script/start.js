addEventListener("DOMContentLoaded", () => {
  overview();
  route();
  addEventListener("hashchange", route);
  document.addEventListener("click", (event) => {
    const link = event.target.closest("a[href^='#']");
    if (link && link.hash === location.hash) route();
  });
  // Plots have the page's colours in them, light or dark.
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    for (const element of document.querySelectorAll("figure[data-drawn]")) element.rest();
  });
  page.dataset.ready = "yes";
});
