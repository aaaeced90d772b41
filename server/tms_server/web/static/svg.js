// Small helpers for elements. Text goes in as text nodes only: names in the data are never read as markup.

const SVG = "http://www.w3.org/2000/svg";

/** An SVG element with attributes and children (elements or text). */
export function svg(name, attributes = {}, ...children) {
  return fill(document.createElementNS(SVG, name), attributes, children);
}

/** The same for HTML. */
export function html(name, attributes = {}, ...children) {
  return fill(document.createElement(name), attributes, children);
}

/** Set attributes; null removes one. Unchanged values are left alone. */
export function set(element, attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined) element.removeAttribute(name);
    else if (element.getAttribute(name) !== String(value)) element.setAttribute(name, value);
  }
  return element;
}

/** Change the text of an element only where it differs. */
export function text(element, words) {
  if (element.textContent !== words) element.textContent = words;
  return element;
}

/**
 * Keep one child per item of `items`, by key, in their order: `make(item)` for new ones, `update(child, item)` for all.
 */
export function keyed(parent, items, key, make, update) {
  const known = new Map();
  for (const child of [...parent.children]) known.set(child.dataset.key, child);
  let previous = null;
  for (const item of items) {
    const id = key(item);
    let child = known.get(id);
    if (child === undefined) {
      child = make(item);
      child.dataset.key = id;
    }
    known.delete(id);
    const place = previous === null ? parent.firstElementChild : previous.nextElementSibling;
    if (place !== child) parent.insertBefore(child, place);
    update(child, item);
    previous = child;
  }
  for (const gone of known.values()) gone.remove();
}

function fill(element, attributes, children) {
  set(element, attributes);
  element.append(...children);
  return element;
}
