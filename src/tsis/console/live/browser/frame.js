// A frame as it comes over the WebSocket: a header of 32 bytes, then pixels of 8 bits or a picture as JPEG or PNG.

const HEADER_BYTES = 32;
const MAGIC = 0x31465354; // "TSF1", lowest byte first
const PICTURE = 1;

// The frame, its pixels as grey levels of 8 bits from `zero` to 255 at full scale above it.
export async function frameOf(data) {
  const view = new DataView(data);
  if (data.byteLength < HEADER_BYTES || view.getUint32(0, true) !== MAGIC) throw new Error("this is no frame");
  const frame = {
    number: view.getUint32(8, true),
    rows: view.getUint16(12, true),
    columns: view.getUint16(14, true),
    arrivedMs: view.getFloat64(16, true),
    fullScale: view.getFloat32(24, true),
    zero: view.getFloat32(28, true),
  };
  const body = new Uint8Array(data, HEADER_BYTES);
  frame.pixels = view.getUint8(4) === PICTURE ? await unpacked(body, frame) : body;
  if (frame.pixels.length !== frame.rows * frame.columns) throw new Error("this is no whole frame");
  return frame;
}

async function unpacked(body, { rows, columns }) {
  const bitmap = await createImageBitmap(new Blob([body]));
  const canvas = new OffscreenCanvas(columns, rows);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(bitmap, 0, 0);
  bitmap.close();
  const colours = new Uint32Array(context.getImageData(0, 0, columns, rows).data.buffer);
  const grey = new Uint8Array(rows * columns);
  for (let at = 0; at < grey.length; at++) grey[at] = colours[at] & 255;
  return grey;
}
