/** Let buttons copy their text to the clipboard and confirm it. */
function copying() {
  const status = make("span", { class: "unseen", role: "status" });
  document.body.append(status);
  document.addEventListener("click", async (event) => {
    const button = event.target.closest("button[data-copy]");
    if (!button) return;
    const says = button.dataset.says ?? (button.dataset.says = button.textContent);
    const done = await copied(button.dataset.copy);
    button.textContent = done ? "Copied" : "Press Ctrl+C";
    status.textContent = done ? "Copied to the clipboard" : "Selected: press Ctrl+C";
    setTimeout(() => { button.textContent = says; status.textContent = ""; }, 2500);
  });
}

/** Copy a text to the clipboard; if that is not allowed, select it. */
async function copied(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    const area = make("textarea", { class: "unseen", readonly: "", "aria-label": "Text to copy" });
    area.value = text;
    document.body.append(area);
    area.select();
    const done = document.execCommand("copy");
    if (done) area.remove(); else area.addEventListener("blur", () => area.remove());
    return done;
  }
}
