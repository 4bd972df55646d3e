// Axes around a relief: the two edges of the floor that lie in front, and the height at the outermost corner.

import { textSize } from "./relief.js";

const TICKS = 5;
const CORNERS = [[0, 0], [1, 0], [1, 1], [0, 1]];

// Draw them; width and depth are the floor's extents in `unit`, `top` the height in grey levels.
export function drawAxes(context, view, { width, depth, unit, top, colour }) {
  const size = textSize(context.canvas.width);
  context.font = `${size}px sans-serif`;
  context.fillStyle = context.strokeStyle = colour;
  context.lineWidth = Math.max(1, size / 12);
  const [u, v] = CORNERS.reduce((best, corner) => (view.near(...corner) > view.near(...best) ? corner : best));
  drawEdge(context, view, (share) => [share, v], width, `x, ${unit}`, size);
  drawEdge(context, view, (share) => [u, share], depth, `y, ${unit}`, size);
  drawHeight(context, view, top, size);
}

function drawEdge(context, view, place, extent, title, size) {
  const point = (share) => [view.across(...place(share)), view.down(...place(share), 0)];
  const [start, end, middle] = [point(0), point(1), point(0.5)];
  const length = Math.hypot(end[0] - start[0], end[1] - start[1]);
  if (length < 6 * size) return; // seen nearly from its end
  let [outX, outY] = [(end[1] - start[1]) / length, (start[0] - end[0]) / length];
  const centre = [view.across(0.5, 0.5), view.down(0.5, 0.5, 0)];
  if ((middle[0] - centre[0]) * outX + (middle[1] - centre[1]) * outY < 0) [outX, outY] = [-outX, -outY];
  line(context, start, end);
  const step = roundStep(extent / Math.min(TICKS, length / (3.5 * size)));
  for (let value = 0; value <= extent * 1.0001; value += step) {
    const [x, y] = point(value / extent);
    line(context, [x, y], [x + 0.4 * size * outX, y + 0.4 * size * outY]);
    text(context, String(Math.round(value * 100) / 100), x + 1.1 * size * outX, y + 1.1 * size * outY);
  }
  text(context, title, middle[0] + (2.2 + 1.6 * Math.abs(outX)) * size * outX, middle[1] + 2.4 * size * outY);
}

function drawHeight(context, view, top, size) {
  const [u, v] = CORNERS.reduce((best, corner) => (view.across(...corner) < view.across(...best) ? corner : best));
  const x = view.across(u, v);
  const [low, high] = [view.down(u, v, 0), view.down(u, v, 1)];
  if (low - high < 3 * size) return;
  line(context, [x, low], [x, high]);
  line(context, [x, high], [x - 0.4 * size, high]);
  const words = `${top} levels`;
  context.textAlign = "right";
  context.textBaseline = "middle";
  context.fillText(words, Math.max(x - 0.6 * size, context.measureText(words).width), high);
}

function roundStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= least * 0.999);
}

function line(context, [x, y], [toX, toY]) {
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(toX, toY);
  context.stroke();
}

function text(context, words, x, y) {
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(words, x, y);
}
