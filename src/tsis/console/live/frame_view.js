// A frame, live or stored, as a map of its pixels by Leaflet: coloured by a table, zoomed, read and measured.

import { leaflet as L } from "nicegui-leaflet";
import { coloured, colourTable, frameOf, gradient, levelText, streamOf } from "tsis-live";

const RATE_EVERY_MS = 500;
const [SATURATED, DARK] = [0xff0000ff, 0xffff0000]; // red and blue, as a canvas packs them
const LEVELS = 5; // zoom levels, each twice as large, beyond the whole frame
const NEAR = 2; // levels from which on pixels are drawn as squares
const STEP = 80; // pixels of the screen that an arrow key moves the frame by
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const TICKS = [0, 0.25, 0.5, 0.75, 1];
const CIRCLE = Array.from({ length: 73 }, (_, at) => [Math.sin((at * Math.PI) / 36), Math.cos((at * Math.PI) / 36)]);
const PIXELS = L.extend({}, L.CRS.Simple, { transformation: new L.Transformation(1, 0, 1, 0) }); // rows downwards
const HOVERS = matchMedia("(hover: hover)"); // else what a finger tapped stays read
const linked = new Map(); // views that zoom as one, by the name of their group

const Zoom = L.Control.Zoom.extend({
  onAdd(map) {
    const bar = L.Control.Zoom.prototype.onAdd.call(this, map);
    this._createButton("⤢", "Show the whole frame", "leaflet-control-whole", bar, () => map.fire("whole"));
    return bar;
  },
});

const Bar = L.Control.Scale.extend({
  _updateMetric(most) {
    const mm = this._getRoundNum(most * this.options.mmPerPixel * 1000) / 1000;
    this._updateScale(this._mScale, `${mm} mm`, mm / (most * this.options.mmPerPixel));
  },
});

const styled = new Promise((resolve) => {
  const link = Object.assign(document.createElement("link"), { rel: "stylesheet", onload: resolve, onerror: resolve });
  link.href = new URL("leaflet/leaflet.css", import.meta.resolve("nicegui-leaflet"));
  document.head.prepend(link); // before the console's own rules
});

export default {
  template: `
    <figure class="live">
      <div ref="stage" class="live-stage" :style="{ aspectRatio: aspect }" @wheel.capture="wheel" @keydown="key">
        <div ref="map" class="live-map" :class="{ measuring: tool }" tabindex="0" role="group"
          aria-label="Frame: plus and minus zoom, arrows move it, 0 shows the whole"
          @pointerdown="grab" @pointermove="stretch" @pointerup="drop" @pointercancel="drop"></div>
        <p v-if="notice || waiting" class="live-waiting"><span>{{ notice || waiting }}</span></p>
      </div>
      <figcaption class="live-caption">
        <span>{{ frozen ? "frozen" : notice || waiting ? "" : rate }}</span><span class="live-read">{{ reading }}</span><span>{{ zoomText }}</span>
      </figcaption>
      <div class="live-legend" aria-hidden="true"><i :style="{ background: gradient }"></i>
        <span v-for="text in ticks">{{ text }}</span></div>
      <p v-if="marks" class="live-marks">{{ marksText }}</p>
    </figure>`,
  mixins: [coloured],
  props: {
    still: String, // a frame as base64, instead of the live ones
    notice: String, // why the image may be old; empty while frames come
    overlay: Boolean, // outline and centre of the contact
    frozen: Boolean, // the image stays while frames come
    marks: Boolean, // saturated pixels red, black ones blue
    tool: String, // what is measured: "profile", "distance", "rectangle", "ellipse"; empty for nothing
    group: String, // of views that are zoomed as one
  },
  emits: ["shape"],
  data: () => ({ rate: "", waiting: "", reading: "", gradient: "", ticks: [], marksText: "", zoom: 1, aspect: "" }),
  computed: {
    zoomText() {
      return this.zoom > 1 ? `${this.zoom.toFixed(1)} x` : "";
    },
  },
  async mounted() {
    this.canvas = Object.assign(document.createElement("canvas"), { className: "live-image" });
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", this.label);
    this.colour();
    await styled;
    if (!this.$refs.map) return; // it is gone already
    this.leaflet = L.map(this.$refs.map, {
      crs: PIXELS, center: [0, 0], zoom: 0, zoomSnap: 0, zoomDelta: 0.5, zoomControl: false, attributionControl: false,
      keyboard: false, inertia: false, zoomAnimation: false, fadeAnimation: false, maxBoundsViscosity: 1, minZoom: -9,
      bounceAtZoomLimits: false, doubleClickZoom: false,
    });
    new Zoom().addTo(this.leaflet);
    this.over = L.layerGroup().addTo(this.leaflet);
    this.shape = L.layerGroup().addTo(this.leaflet);
    this.leaflet.on("whole dblclick", () => this.whole()).on("zoom zoomend", () => this.zoomed()).on("move", () => this.follow());
    this.leaflet.on("mousemove click", (event) => this.read(event.latlng)).on("mouseout", () => HOVERS.matches && this.read(null));
    this.observer = new ResizeObserver(() => this.resized());
    this.observer.observe(this.$refs.map);
    this.views = (this.group && linked.get(this.group)) || new Set();
    linked.set(this.group, this.views.add(this));
    if (this.address) {
      this.stream = streamOf(this.address);
      this.leave = this.stream.join({
        frame: (frame) => this.frozen || this.draw(frame),
        analysis: (analysis) => this.see(analysis),
        waiting: (label) => (this.waiting = label),
      });
    } else this.drawStill();
  },
  unmounted() {
    this.leave?.();
    this.observer?.disconnect();
    this.views?.delete(this);
    this.leaflet?.remove();
    this.layer = this.leaflet = null;
  },
  watch: {
    still() {
      this.drawStill();
    },
    label(text) {
      this.canvas.setAttribute("aria-label", text);
    },
    colours() {
      this.recolour();
    },
    ends() {
      this.recolour();
    },
    marks() {
      this.recolour();
    },
    overlay() {
      this.drawOver();
    },
    frozen(now) {
      if (!now && this.stream?.frame) this.draw(this.stream.frame);
    },
    mmPerPixel() {
      this.scaleBar();
    },
    tool() {
      this.begin();
    },
  },
  methods: {
    async drawStill() {
      if (this.still) this.draw(await frameOf(Uint8Array.from(atob(this.still), (letter) => letter.charCodeAt(0)).buffer));
    },
    see(analysis) {
      this.analysis = analysis;
      this.drawOver();
    },
    colour() {
      this.table = colourTable(this.colours, this.ends);
      this.gradient = gradient(this.colours, this.ends);
      if (this.marks) [this.table[255], this.table[0]] = [SATURATED, DARK];
      this.legend();
    },
    legend() {
      const [low, high] = this.ends;
      this.ticks = TICKS.map((share) => levelText(this.shown, low + share * (high - low)));
    },
    recolour() {
      this.colour();
      const frame = this.shown ?? this.stream?.frame;
      if (frame && this.leaflet) this.draw(frame); // also while no frames come
    },
    draw(frame) {
      const { canvas } = this;
      const other = this.shown?.fullScale !== frame.fullScale || this.shown?.zero !== frame.zero;
      this.shown = frame;
      if (!this.layer || canvas.width !== frame.columns || canvas.height !== frame.rows) this.place(frame);
      if (other) this.legend();
      const { table, packed } = this;
      const { pixels } = frame;
      for (let at = 0; at < packed.length; at++) packed[at] = table[pixels[at]];
      this.context.putImageData(this.picture, 0, 0);
      if (this.marks) this.marksText = marked(pixels);
      const now = performance.now();
      if (!(now - this.rateAt < RATE_EVERY_MS)) {
        this.rateAt = now;
        this.read(this.at);
        this.rate = this.stream ? `${this.stream.rate().toFixed(0)} frames/s shown` : "";
      }
    },
    place({ rows, columns }) {
      const { canvas } = this;
      [canvas.width, canvas.height] = [columns, rows];
      this.context = canvas.getContext("2d", { alpha: false });
      this.picture = this.context.createImageData(columns, rows);
      this.packed = new Uint32Array(this.picture.data.buffer);
      this.aspect = `${columns} / ${rows}`;
      this.layer?.remove();
      this.layer = L.svgOverlay(canvas, [[0, 0], [rows, columns]]).addTo(this.leaflet);
      this.whole();
      this.scaleBar();
      this.begin();
    },
    // The size of the place for the map has changed: what was seen stays seen, and what was whole stays whole.
    resized() {
      if (!this.isSeen()) return;
      this.alone(() => this.leaflet.invalidateSize({ animate: false, pan: false }));
      if (this.views.level > 0.01) this.look();
      else this.whole();
    },
    isSeen() {
      return Boolean(this.layer && this.$refs.map?.clientWidth);
    },
    // Look at what the group looks at.
    look() {
      this.limit();
      this.leaflet.setView(this.views.centre, this.least + this.views.level, { animate: false });
    },
    limit() {
      this.alone(() => {
        this.leaflet.setMinZoom(-9).setMaxZoom(Infinity); // else the limits of a frame of another shape bound the answer
        this.least = this.leaflet.getBoundsZoom(this.layer.getBounds());
        this.leaflet.setMinZoom(this.least).setMaxZoom(this.least + LEVELS);
      });
    },
    // Act so that the group does not follow what moves: nobody chose it.
    alone(act) {
      const { busy } = this.views;
      this.views.busy = true;
      act();
      this.views.busy = busy;
    },
    whole() {
      if (!this.layer) return;
      this.leaflet.setMaxBounds(null); // which would move the frame gradually
      this.limit();
      this.leaflet.fitBounds(this.layer.getBounds(), { animate: false }).setMaxBounds(this.layer.getBounds());
      this.zoomed();
    },
    zoomed() {
      const level = this.leaflet.getZoom() - this.least;
      this.zoom = level > 0.01 ? 2 ** level : 1;
      this.$refs.map.classList.toggle("near", level > NEAR);
      this.leaflet.dragging[this.zoom > 1 && !this.tool ? "enable" : "disable"](); // else a finger scrolls the page
    },
    follow() {
      if (this.views.busy || !this.isSeen()) return;
      this.views.busy = true;
      [this.views.centre, this.views.level] = [this.leaflet.getCenter(), this.leaflet.getZoom() - this.least];
      for (const view of this.views) if (view !== this && view.isSeen()) view.look();
      this.views.busy = false;
    },
    wheel(event) {
      if (!event.ctrlKey && !this.$el.closest(".alone")) event.stopPropagation(); // it scrolls the page
    },
    key(event) {
      if (event.target !== this.$refs.map || event.ctrlKey || event.altKey || event.metaKey) return;
      if (event.key === "0") this.whole();
      else if (event.key === "+" || event.key === "=") this.leaflet.zoomIn();
      else if (event.key === "-") this.leaflet.zoomOut();
      else if (event.key in ARROWS && this.zoom > 1)
        this.leaflet.panBy(ARROWS[event.key].map((way) => way * STEP), { animate: false });
      else return;
      event.preventDefault();
      event.stopPropagation(); // elsewhere arrows choose a target
    },
    read(at) {
      this.at = at;
      const [x, y] = at ? [Math.floor(at.lng), Math.floor(at.lat)] : [-1, -1];
      const { rows, columns, pixels } = this.shown ?? { rows: 0, columns: 0 };
      const inside = x >= 0 && y >= 0 && x < columns && y < rows;
      const [wide, high] = this.mmPerPixel ?? [];
      const mm = wide ? ` · ${((x - (columns - 1) / 2) * wide).toFixed(2)}, ${((y - (rows - 1) / 2) * high).toFixed(2)} mm from the centre` : "";
      this.reading = inside ? `x ${x}, y ${y}${mm} · grey ${levelText(this.shown, pixels[y * columns + x])}` : "";
    },
    scaleBar() {
      this.bar?.remove();
      this.bar = null;
      if (this.mmPerPixel && this.leaflet)
        this.bar = new Bar({ imperial: false, position: "bottomright", maxWidth: 160, mmPerPixel: this.mmPerPixel[0] }).addTo(this.leaflet);
    },
    drawOver() {
      if (!this.leaflet) return;
      this.over.clearLayers();
      const contact = this.overlay && this.analysis?.contact;
      if (!contact) return;
      const [x, y] = contact.centroid_px.map((place) => place + 0.5);
      const arm = this.shown ? this.shown.columns / 76 : 10;
      const lines = [
        contact.outline_px.map(([x, y]) => [y + 0.5, x + 0.5]),
        [[y, x - arm], [y, x + arm]],
        [[y - arm, x], [y + arm, x]],
      ];
      lines.forEach((line, at) => this.line(this.over, line, at === 0));
    },
    line(layer, places, closed) {
      const kind = closed ? L.polygon : L.polyline;
      kind(places, { interactive: false, fill: false, color: "#fff", weight: 2, smoothFactor: 0, className: "live-line" }).addTo(layer);
    },
    // What is measured begins in the middle of what is seen; its ends are moved by hand or by arrow keys.
    begin() {
      if (!this.layer) return;
      this.zoomed();
      if (!this.tool) {
        this.shape.clearLayers();
        return;
      }
      const centre = this.leaflet.getSize().divideBy(2);
      this.points = [-0.15, 0.15].map((share) => this.leaflet.containerPointToLatLng(centre.add(this.leaflet.getSize().multiplyBy(share))));
      this.handles = this.points.map((place, at) => {
        const icon = L.divIcon({ className: "live-handle", iconSize: [24, 24] });
        const handle = L.marker(place, { icon, draggable: true, autoPan: false, title: `Point ${at + 1} of what is measured` });
        return handle.on("drag", () => this.move(at, handle.getLatLng())).on("keydown", (event) => this.nudge(at, event.originalEvent));
      });
      this.measure();
    },
    move(at, place) {
      const { rows, columns } = this.shown;
      this.points[at] = L.latLng(Math.min(Math.max(place.lat, 0), rows), Math.min(Math.max(place.lng, 0), columns));
      this.measure();
    },
    nudge(at, event) {
      const [x, y] = ARROWS[event.key] ?? [];
      if (x === undefined) return;
      const by = event.shiftKey ? 10 : 1; // pixels of the frame
      this.move(at, L.latLng(this.points[at].lat + by * y, this.points[at].lng + by * x));
      event.preventDefault();
      event.stopPropagation();
    },
    grab(event) {
      this.drawing = false;
      if (!this.tool || !this.layer || !event.isPrimary || event.target.closest(".live-handle, .leaflet-control")) return;
      this.drawing = true;
      this.points = [this.leaflet.mouseEventToLatLng(event), this.leaflet.mouseEventToLatLng(event)];
      this.$refs.map.setPointerCapture(event.pointerId);
    },
    stretch(event) {
      if (this.drawing && event.isPrimary) this.move(1, this.leaflet.mouseEventToLatLng(event));
    },
    drop() {
      this.drawing = false;
    },
    measure() {
      const [a, b] = this.points;
      this.shape.clearLayers();
      const middle = [(a.lat + b.lat) / 2, (a.lng + b.lng) / 2];
      const places = {
        rectangle: [a, [a.lat, b.lng], b, [b.lat, a.lng]],
        ellipse: CIRCLE.map(([y, x]) => [middle[0] + (y * (b.lat - a.lat)) / 2, middle[1] + (x * (b.lng - a.lng)) / 2]),
      };
      this.line(this.shape, places[this.tool] ?? [a, b], this.tool in places);
      this.handles.forEach((handle, at) => handle.setLatLng(this.points[at]).addTo(this.shape));
      this.$emit("shape", this.tool, ...[a, b].map((place) => [place.lng - 0.5, place.lat - 0.5]));
    },
    // For those who judge the view: of the last frames, when each was drawn and how old it was then, ms.
    measured() {
      return this.stream.drawn;
    },
  },
};

function marked(pixels) {
  let [full, none] = [0, 0];
  for (const level of pixels) {
    if (level === 255) full++;
    else if (level === 0) none++;
  }
  const share = (count) => `${((100 * count) / pixels.length).toFixed(2)} %`;
  return `red: saturated, ${share(full)}; blue: black, ${share(none)}`;
}
