// What is drawn over the live image: the scale bar, and the contact.

const BAR_SHARE = 0.25; // of the image's width, which the scale bar comes close to from below
const ROUND_MM = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50];

// Draws the scale bar and returns what it says; sizes follow the image's.
export function drawBar(context, mmPerPixel) {
  const { width, height } = context.canvas;
  const length = ROUND_MM.filter((mm) => mm <= BAR_SHARE * width * mmPerPixel).pop();
  if (!length) return "";
  const unit = width / 768;
  const pixels = length / mmPerPixel;
  const [x, y] = [width - pixels - 0.03 * width, height - 0.05 * height];
  context.fillStyle = "rgba(0, 0, 0, 0.55)";
  context.fillRect(x - 8 * unit, y - 26 * unit, pixels + 16 * unit, 40 * unit);
  context.fillStyle = "#ffffff";
  context.fillRect(x, y, pixels, 5 * unit);
  context.font = `${18 * unit}px sans-serif`;
  context.textAlign = "center";
  context.fillText(`${length} mm`, x + pixels / 2, y - 7 * unit);
  return `bar ${length} mm`;
}

// Outline and centroid, white on black, so that they are seen on every colour.
export function drawContact(context, contact) {
  const unit = context.canvas.width / 768;
  const path = new Path2D();
  contact.outline_px.forEach(([x, y], at) => (at ? path.lineTo(x + 0.5, y + 0.5) : path.moveTo(x + 0.5, y + 0.5)));
  path.closePath();
  const [x, y] = contact.centroid_px.map((place) => place + 0.5);
  const arm = 10 * unit;
  const cross = new Path2D(`M${x - arm} ${y}h${2 * arm}M${x} ${y - arm}v${2 * arm}`);
  for (const [width, colour] of [
    [4, "rgba(0, 0, 0, 0.6)"],
    [2, "#ffffff"],
  ]) {
    context.lineWidth = width * unit;
    context.strokeStyle = colour;
    context.stroke(path);
    context.stroke(cross);
  }
}
