// Creates HTML and SVG elements from text; text of traces is never parsed as markup.
const SVG = "http://www.w3.org/2000/svg";

export function html(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

export function svg(name, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

export function row(...cells) {
  return html("tr", {}, ...cells.map((cell) => html("td", {}, String(cell))));
}
