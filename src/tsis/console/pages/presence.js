// Reports whether the page is visible, and the operator's name that this browser keeps; makes controls inert while the
// connection to the console is lost.

export default {
  template: `<span hidden></span>`,
  emits: ["visible", "operator"],
  mounted() {
    this.report = () => this.$emit("visible", !document.hidden);
    document.addEventListener("visibilitychange", this.report);
    if (document.hidden) this.report();
    const popup = document.getElementById("popup");
    const show = () => {
      const lost = popup.ariaHidden === "false";
      for (const part of document.querySelectorAll(".bar, .content")) part.inert = lost;
    };
    this.watch = new MutationObserver(show);
    this.watch.observe(popup, { attributes: true });
    try {
      const name = localStorage.getItem("tsis-operator");
      if (name) this.$emit("operator", name);
    } catch { /* storage is refused: the name is asked for again */ }
  },
  unmounted() {
    document.removeEventListener("visibilitychange", this.report);
    this.watch.disconnect();
  },
};
