// The live image on a canvas: colours by a table, what was found drawn over it, read under the pointer, zoomed, frozen.

import {
  WHOLE, coloured, colourTable, drawBar, drawContact, endsOf, panned, pixelAt, readOut, streamOf, zoomed,
} from "tsis-live";

const RATE_EVERY_MS = 500;
const [SATURATED, DARK] = [0xff0000ff, 0xffff0000]; // red and blue, as a canvas packs them
const STOPS = 16; // of the legend's colours
const KEYS = { "+": 1, "=": 1, "-": -1 };

export default {
  template: `
    <figure class="live">
      <div ref="stage" class="live-stage" tabindex="0" role="group" aria-label="Image: plus and minus zoom, 0 shows the whole"
        @pointermove="point" @pointerdown="grab" @pointerup="grip = null" @pointerleave="leaveStage" @wheel.prevent="wheel"
        @dblclick="view = whole" @keydown="key">
        <div class="live-zoom" :class="{ near: view.zoom > 4 }" :style="{ transform }">
          <canvas ref="image" class="live-image" role="img" :aria-label="label"></canvas>
          <canvas ref="over" class="live-over" aria-hidden="true"></canvas>
        </div>
        <p v-if="notice || waiting" class="live-waiting"><span>{{ notice || waiting }}</span></p>
      </div>
      <figcaption class="live-caption">
        <span>{{ frozen ? "frozen" : notice || waiting ? "" : rate }}</span><span class="live-read">{{ reading }}</span><span>{{ zoomText }}</span>
      </figcaption>
      <div class="live-legend">
        <span>{{ lowText }}</span><i :style="{ background: gradient }"></i><span>{{ highText }}</span>
        <span v-if="marks" class="live-marks">{{ marksText }}</span>
      </div>
    </figure>`,
  mixins: [coloured],
  props: {
    notice: String, // why the image may be old; empty while frames come
    overlay: Boolean,
    frozen: Boolean, // the image stays while frames come
    marks: Boolean, // saturated pixels red, black ones blue
  },
  data: () => ({ rate: "", waiting: "", reading: "", lowText: "", highText: "", gradient: "", marksText: "", view: WHOLE, whole: WHOLE }),
  computed: {
    transform() {
      return `translate(${this.view.x}px, ${this.view.y}px) scale(${this.view.zoom})`;
    },
    zoomText() {
      return this.view.zoom > 1 ? `${this.view.zoom.toFixed(1)} x` : "";
    },
  },
  mounted() {
    this.colour();
    this.stream = streamOf(this.address);
    this.leave = this.stream.join({
      frame: (frame) => this.frozen || this.draw(frame),
      analysis: (analysis) => this.see(analysis),
      waiting: (label) => (this.waiting = label),
    });
  },
  unmounted() {
    this.leave();
  },
  watch: {
    colours() {
      this.recolour();
    },
    ends() {
      this.recolour();
    },
    overlay() {
      this.drawOver();
    },
    marks() {
      this.recolour();
    },
    frozen(now) {
      if (!now && this.stream?.frame) this.draw(this.stream.frame);
    },
    mmPerPixel() {
      this.drawOver();
    },
  },
  methods: {
    see(analysis) {
      this.analysis = analysis;
      if (this.ends === "auto") this.colour();
      this.drawOver();
    },
    colour() {
      const ends = endsOf(this.ends, this.analysis?.histogram);
      this.table = colourTable(this.colours, ends);
      this.gradient = gradientOf(this.colours);
      if (this.marks) [this.table[255], this.table[0]] = [SATURATED, DARK];
      this.legend(ends);
    },
    legend(ends) {
      const unit = (this.shown?.fullScale || 255) / 255;
      [this.lowText, this.highText] = [`grey ${Math.round(ends[0] * unit)}`, `${Math.round(ends[1] * unit)}`];
    },
    recolour() {
      this.colour();
      const frame = this.shown ?? this.stream?.frame;
      if (frame) this.draw(frame); // also while no frames come
    },
    size() {
      return [this.$refs.stage.clientWidth, this.$refs.stage.clientHeight];
    },
    point(event) {
      if (this.grip) {
        this.view = panned(this.view, [event.clientX - this.grip[0], event.clientY - this.grip[1]], this.size());
        this.grip = [event.clientX, event.clientY];
      }
      this.pointer = [event.clientX, event.clientY];
      this.read();
    },
    read() {
      const canvas = this.$refs.image;
      const at = this.pointer && this.shown && pixelAt(canvas.getBoundingClientRect(), this.shown, ...this.pointer);
      this.reading = at ? readOut(this.shown, at, this.mmPerPixel) : "";
    },
    grab(event) {
      this.grip = this.view.zoom > 1 ? [event.clientX, event.clientY] : null;
    },
    leaveStage() {
      this.pointer = this.grip = null;
      this.reading = "";
    },
    wheel(event) {
      const box = this.$refs.stage.getBoundingClientRect();
      const place = [event.clientX - box.left, event.clientY - box.top];
      this.view = zoomed(this.view, event.deltaY < 0 ? 1 : -1, place, this.size());
    },
    key(event) {
      if (event.key === "0") this.view = WHOLE;
      if (event.key in KEYS) this.view = zoomed(this.view, KEYS[event.key], this.size().map((all) => all / 2), this.size());
    },
    draw(frame) {
      const canvas = this.$refs.image;
      if (!canvas) return;
      if (!this.context || canvas.width !== frame.columns || canvas.height !== frame.rows) {
        canvas.width = frame.columns;
        canvas.height = frame.rows;
        this.context = canvas.getContext("2d", { alpha: false });
        this.picture = this.context.createImageData(frame.columns, frame.rows);
        this.packed = new Uint32Array(this.picture.data.buffer);
        this.drawOver();
      }
      if (this.shown?.fullScale !== frame.fullScale) {
        this.shown = frame;
        this.legend(endsOf(this.ends, this.analysis?.histogram));
      }
      this.shown = frame;
      const { table, packed } = this;
      const { pixels } = frame;
      for (let at = 0; at < packed.length; at++) packed[at] = table[pixels[at]];
      this.context.putImageData(this.picture, 0, 0);
      if (this.marks) this.marksText = marked(pixels);
      const now = performance.now();
      if (!(now - this.rateAt < RATE_EVERY_MS)) {
        this.rateAt = now;
        this.read();
        this.rate = `${this.stream?.rate().toFixed(0) ?? 0} frames/s shown`;
      }
    },
    drawOver() {
      const canvas = this.$refs.over;
      const image = this.$refs.image;
      if (!canvas || !this.context) return;
      canvas.width = image.width;
      canvas.height = image.height;
      const context = canvas.getContext("2d");
      if (this.mmPerPixel) drawBar(context, this.mmPerPixel[0]);
      if (this.overlay && this.analysis?.contact) drawContact(context, this.analysis.contact);
    },
    // For those who judge the view: of the last frames, when each was drawn and how old it was then, ms.
    measured() {
      return this.stream.drawn;
    },
  },
};

function gradientOf(colours) {
  const stops = Array.from({ length: STOPS + 1 }, (_, at) => colours[Math.round((255 * at) / STOPS)]);
  const css = stops.map((packed) => `rgb(${packed & 255}, ${(packed >> 8) & 255}, ${(packed >> 16) & 255})`);
  return `linear-gradient(to right, ${css.join(", ")})`;
}

function marked(pixels) {
  let [full, none] = [0, 0];
  for (const level of pixels) {
    if (level === 255) full++;
    else if (level === 0) none++;
  }
  const share = (count) => `${((100 * count) / pixels.length).toFixed(2)} %`;
  return `red: saturated, ${share(full)}; blue: black, ${share(none)}`;
}
