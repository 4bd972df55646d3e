// What the elements of the live view share; a page loads it once, so that they share one connection too.

export { coloured, colourTable, gradient, levelText } from "./colours.js";
export { frameOf } from "./frame.js";
export { streamOf } from "./stream.js";
