// For many cases, pages and packs are in files next to this one.
const beside = JSON.parse(document.getElementById("parts")?.textContent ?? '{"places": {}}');
const arriving = new Map();

/** Called by files of cases with their name, pages and packs. */
globalThis.crosscheckPart = (name, pages, packed) => arriving.get(name)?.resolve({ pages, packed });

/** Load the file with an id once, and add its pages and packs to the document. */
function part(id) {
  const name = beside.names[beside.places[id]];
  if (!arriving.has(name)) {
    const one = {};
    one.whole = new Promise((resolve, reject) => Object.assign(one, { resolve, reject })).then(taken);
    arriving.set(name, one);
    const script = make("script", { src: `${beside.folder}/${name}` });
    script.addEventListener("error", () => {
      arriving.delete(name);
      one.reject(new Error(`the file ${beside.folder}/${name} can't be read; keep it together with this page`));
    });
    document.head.append(script);
  }
  return arriving.get(name).whole;
}

async function taken({ pages, packed }) {
  const { html } = await unpack(pages);
  document.getElementById("main").insertAdjacentHTML("beforeend", html);
  for (const [id, text] of Object.entries(packed)) packs.set(id, unpack(text));
}

/** Return whether an id is in a file that has not been loaded. */
const away = (id) => Object.hasOwn(beside.places, id) && !document.getElementById(id) && !packs.has(id);
