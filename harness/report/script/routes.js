/** What the address points to; the overview where it points nowhere. */
function target() {
  const id = location.hash.slice(1);
  const found = id && document.getElementById(id);
  if (found) return found;
  try {
    return document.getElementById(decodeURIComponent(id)) ?? document.getElementById("overview");
  } catch {
    return document.getElementById("overview");
  }
}

/** Show the view that the address points to, and no other; build its plots. */
function route() {
  const to = target();
  const view = to.closest(".view") ?? document.getElementById("overview");
  for (const other of document.querySelectorAll(".view.current")) {
    if (other === view) continue;
    other.classList.remove("current");
    for (const element of other.querySelectorAll("figure[data-drawn]")) element.rest();
  }
  view.classList.add("current");
  if (view instanceof HTMLDetailsElement) view.open = true;
  const heading = view.querySelector("h1, h2, .name");
  document.title = `crosscheck: ${heading.textContent.trim()}`;
  if (to === view) scrollTo(0, 0); else to.scrollIntoView();
  opened(view);
}

function opened(view) {
  for (const box of view.querySelectorAll("[data-pack]")) {
    if (box.dataset.built) drawRest(box); else build(box);
  }
}
