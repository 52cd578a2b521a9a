"use strict";
/* What all parts use: finding elements by their role, making new ones, writing numbers. */

function part(root, role) {
  return root.querySelector(`[data-role="${role}"]`);
}

function parts(root, role) {
  return [...root.querySelectorAll(`[data-role="${role}"]`)];
}

function data(root, role) {
  return JSON.parse(part(root, role).textContent);
}

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

function make(name, attributes = {}, ...children) {
  return fill(document.createElement(name), attributes, children);
}

/* An element of a drawing, in the namespace of the one that it goes into. */
function draw(into, name, attributes = {}, ...children) {
  return fill(document.createElementNS(into.namespaceURI, name), attributes, children);
}

function fixed(value, digits = 2) {
  if (value === null) return "–";
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}

function degrees(value) {
  return value === null ? "–" : `${fixed(value, 0)}°`;
}
