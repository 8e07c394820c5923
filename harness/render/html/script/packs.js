// Errors are stored in the page, for tests and for bug reports.
const page = document.documentElement;
const note = (name, what) => {
  page.dataset[name] = page.dataset[name] ? `${page.dataset[name]} | ${what}` : what;
};
addEventListener("error", (event) => note("errors", event.message));
addEventListener("unhandledrejection", (event) => note("errors", String(event.reason)));
document.addEventListener("securitypolicyviolation", (event) => note("blocked", event.blockedURI));

const packs = new Map();

/** Return the content of a pack, unpacked once. */
async function pack(id) {
  if (away(id)) await part(id);
  if (!packs.has(id)) packs.set(id, unpack(document.getElementById(id).textContent));
  return packs.get(id);
}

/** Return the bytes of a text in base64. */
function bytesOf(text) {
  const letters = atob(text), bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i += 1) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

async function unpack(text) {
  const bytes = bytesOf(text);
  const gzip = new DecompressionStream("gzip");
  const writer = gzip.writable.getWriter();
  writer.write(bytes);
  writer.close();
  return JSON.parse(await new Response(gzip.readable).text());
}

/** Return a column of the pack `own`, or of another: `[pack, key]`. Missing values are NaN. */
async function column(own, reference) {
  const [id, key] = Array.isArray(reference) ? reference : [own, reference];
  return (await pack(id)).columns[key].map((value) => value ?? NaN);
}

/** Return the chart's curves with their numbers. */
async function filled(own, chart) {
  const curves = chart.curves.map(async (curve) => ({
    ...curve, x: await column(own, curve.x), y: await column(own, curve.y),
  }));
  return { ...chart, curves: await Promise.all(curves) };
}

/** Return a number in five digits. */
const short = (value) => (Number.isFinite(value) ? Number(value.toPrecision(5)).toString() : "–");

const SVG = "http://www.w3.org/2000/svg";

/** Create an element with attributes and children; strings become text. */
const make = (tag, attributes, ...children) => dressed(document.createElement(tag), attributes, children);
const svg = (tag, attributes, ...children) => dressed(document.createElementNS(SVG, tag), attributes, children);

function dressed(element, attributes = {}, children = []) {
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}
