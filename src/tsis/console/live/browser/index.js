// What the elements of the live view share; a page loads it once, so that they share one connection too.

export { drawAxes } from "./axes.js";
export { coloured, colourTable, endsOf } from "./colours.js";
export { drawBar, drawContact } from "./marks.js";
export { blockMeans, Relief } from "./relief.js";
export { streamOf } from "./stream.js";
export { WHOLE, panned, pixelAt, readOut, zoomed } from "./pointer.js";
