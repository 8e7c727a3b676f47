// E over time as one line, with the numbers at its ends.

import { number } from "./format.js";

const MARGIN = 4;

export function drawPlot(canvas, points) {
  const ratio = Math.min(2, window.devicePixelRatio || 1), width = canvas.clientWidth, height = canvas.clientHeight;
  if (!width || !height) return;
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  const context = canvas.getContext("2d"), style = getComputedStyle(canvas);
  context.scale(ratio, ratio);
  context.clearRect(0, 0, width, height);
  if (points.length < 2) return;
  const values = points.map(([, e]) => e), low = Math.min(...values), high = Math.max(...values);
  const begin = points[0][0], span = points.at(-1)[0] - begin || 1, room = high - low || Math.abs(high) * 1e-3 || 1;
  const right = width - 52;
  const at = ([t, e]) => [MARGIN + ((right - MARGIN) * (t - begin)) / span, height - MARGIN - ((height - 2 * MARGIN) * (e - low)) / room];
  context.strokeStyle = style.getPropertyValue("--accent-text");
  context.lineWidth = 1.5;
  context.lineJoin = "round";
  context.beginPath();
  for (const point of points) context.lineTo(...at(point));
  context.stroke();
  context.fillStyle = context.strokeStyle;
  context.beginPath();
  context.arc(...at(points.at(-1)), 2.5, 0, 7);
  context.fill();
  context.fillStyle = style.getPropertyValue("--quiet");
  context.font = "11px system-ui, sans-serif";
  context.textBaseline = "top";
  context.fillText(number(high), right + 6, MARGIN - 2);
  context.textBaseline = "bottom";
  context.fillText(number(low), right + 6, height - MARGIN + 2);
}
