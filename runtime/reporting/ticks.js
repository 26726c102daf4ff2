// Numbers of an axis, for the charts of reports and of the studio.

"use strict";

/** Round numbers between two, with their labels: steps of 1, 2 or 5 times a power of ten, about `count` of them and at least two. */
function ticks(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= raw * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  if (found.length < 2) return ticks(low, high, 2 * count);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return found.map((value) => [value, minus(value.toFixed(digits))]);
}

const minus = (text) => (Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−"));
