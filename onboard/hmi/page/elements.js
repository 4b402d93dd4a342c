// Elements with text, which is never interpreted as HTML.

export function make(name, kind, words) {
  const element = document.createElement(name);
  if (kind) element.className = kind;
  element.textContent = words;
  return element;
}
