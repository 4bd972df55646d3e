// The live image on a canvas: colours by a table, what was found drawn over it.

import { coloured, colourTable, drawBar, drawContact, endsOf, streamOf } from "tsis-live";

const RATE_EVERY_MS = 500;

export default {
  template: `
    <figure class="live">
      <div class="live-stage">
        <canvas ref="image" class="live-image" role="img" :aria-label="label"></canvas>
        <canvas ref="over" class="live-over" aria-hidden="true"></canvas>
        <p v-if="notice || waiting" class="live-waiting"><span>{{ notice || waiting }}</span></p>
      </div>
      <figcaption class="live-caption"><span>{{ rate }}</span><span>{{ endsText }}</span><span>{{ scaleText }}</span>
      </figcaption>
    </figure>`,
  mixins: [coloured],
  props: {
    notice: String, // why the image may be old; empty while frames come
    overlay: Boolean,
  },
  data: () => ({ rate: "", waiting: "", scaleText: "", endsText: "" }),
  mounted() {
    this.colour();
    this.stream = streamOf(this.address);
    this.leave = this.stream.join({
      frame: (frame) => this.draw(frame),
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
      this.endsText = ends[0] === 0 && ends[1] === 255 ? "" : `colours from ${ends[0]} to ${ends[1]} of 255`;
    },
    recolour() {
      this.colour();
      if (this.stream?.frame) this.draw(this.stream.frame); // also while no frames come
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
      const { table, packed } = this;
      const { pixels } = frame;
      for (let at = 0; at < packed.length; at++) packed[at] = table[pixels[at]];
      this.context.putImageData(this.picture, 0, 0);
      const now = performance.now();
      if (!(now - this.rateAt < RATE_EVERY_MS)) {
        this.rateAt = now;
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
      this.scaleText = this.mmPerPixel ? drawBar(context, this.mmPerPixel[0]) : "";
      if (this.overlay && this.analysis?.contact) drawContact(context, this.analysis.contact);
    },
    // For those who judge the view: of the last frames, when each was drawn and how old it was then, ms.
    measured() {
      return this.stream.drawn;
    },
  },
};
