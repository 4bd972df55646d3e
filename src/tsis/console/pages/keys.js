// Keys of the page, as its shortcuts are defined there; "alone" shows the live image over the whole screen.

const FIELDS = "input, textarea, select, [contenteditable], [role=slider], [role=listbox], [role=menu], [role=tab], dialog, .q-dialog, .surface";

export default {
  template: "<span hidden></span>",
  props: {
    alone: String, // id of the element that can be shown alone
    force: String, // id of the field of the force
    keys: Object, // by the key: the event and its value
  },
  emits: ["snapshot", "step", "role", "run", "estimate", "report"],
  mounted() {
    this.down = (event) => this.pressed(event);
    this.clicked = (event) => {
      // A button that was clicked would take the next space for a click of its own.
      const button = event.detail > 0 && event.target.closest?.("button, [role=switch], [role=tab]");
      if (button && button.contains(document.activeElement)) document.activeElement.blur();
    };
    this.toggle = () => this.show(!this.shown);
    this.changed = () => document.fullscreenElement || this.show(false);
    window.addEventListener("keydown", this.down);
    window.addEventListener("click", this.clicked);
    document.addEventListener("tsis-alone", this.toggle);
    document.addEventListener("fullscreenchange", this.changed);
  },
  unmounted() {
    this.show(false);
    window.removeEventListener("keydown", this.down);
    window.removeEventListener("click", this.clicked);
    document.removeEventListener("tsis-alone", this.toggle);
    document.removeEventListener("fullscreenchange", this.changed);
  },
  methods: {
    pressed(event) {
      if (event.ctrlKey || event.altKey || event.metaKey || event.repeat) return;
      if (event.key === "Escape" && this.shown) this.show(false);
      const at = event.target;
      const number = event.key === " " && at.closest?.("[inputmode=decimal], [inputmode=numeric]"); // no number has a blank
      if (number) number.blur(); // the page takes what was typed
      else if (at.closest?.(FIELDS)) return;
      if (event.key === " " && at.closest?.("button, a, [role=switch]")) return;
      const [does, value] = this.keys[event.key.length === 1 ? event.key.toLowerCase() : event.key] || [];
      if (does === "alone") this.toggle();
      else if (does === "force") this.type();
      else if (does) this.$emit(does, value);
      else return;
      event.preventDefault();
    },
    type() {
      const place = document.getElementById(this.force);
      const field = place?.matches("input") ? place : place?.querySelector("input");
      field?.focus();
      field?.select();
    },
    show(alone) {
      this.shown = alone;
      document.getElementById(this.alone)?.classList.toggle("alone", alone);
      document.body.classList.toggle("showing-alone", alone);
      // Not every browser can, or lets a page: the live image fills the window nevertheless.
      if (alone) document.documentElement.requestFullscreen?.().catch(() => {});
      else if (document.fullscreenElement) document.exitFullscreen().catch(() => {});
    },
  },
};
