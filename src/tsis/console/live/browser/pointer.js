// Where a pointer lies in an image, and how an image is zoomed and panned in its stage.

const MOST = 32; // times the size that fills the stage
const STEP = 1.25; // of one notch of the wheel or one key

// The place of a frame's pixel under a point of the screen; null outside. `rect` is that of the canvas as it is drawn,
// which shows the whole frame as large as fits.
export function pixelAt(rect, { rows, columns }, clientX, clientY) {
  const scale = Math.min(rect.width / columns, rect.height / rows);
  const x = Math.floor((clientX - rect.left - (rect.width - columns * scale) / 2) / scale);
  const y = Math.floor((clientY - rect.top - (rect.height - rows * scale) / 2) / scale);
  return x >= 0 && x < columns && y >= 0 && y < rows ? [x, y] : null;
}

// What is read there: pixel, millimetres from the centre of the image where the scale is known, and grey level.
export function readOut(frame, [x, y], mmPerPixel) {
  const grey = (frame.pixels[y * frame.columns + x] / 255) * (frame.fullScale || 255);
  const mm = mmPerPixel
    ? ` · ${((x - (frame.columns - 1) / 2) * mmPerPixel[0]).toFixed(2)}, ` +
      `${((y - (frame.rows - 1) / 2) * mmPerPixel[1]).toFixed(2)} mm from the centre`
    : "";
  return `x ${x}, y ${y}${mm} · grey ${grey.toFixed(0)} of ${frame.fullScale || 255}`;
}

export const WHOLE = { zoom: 1, x: 0, y: 0 };

// A view zoomed by a number of notches about a point of the stage; it always fills the stage.
export function zoomed(view, notches, [x, y], size) {
  const zoom = Math.min(Math.max(view.zoom * STEP ** notches, 1), MOST);
  const factor = zoom / view.zoom;
  return within({ zoom, x: x - factor * (x - view.x), y: y - factor * (y - view.y) }, size);
}

export function panned(view, [dx, dy], size) {
  return within({ zoom: view.zoom, x: view.x + dx, y: view.y + dy }, size);
}

function within({ zoom, x, y }, [width, height]) {
  const inside = (value, extent) => Math.min(0, Math.max(value, extent * (1 - zoom)));
  return { zoom, x: inside(x, width), y: inside(y, height) };
}
