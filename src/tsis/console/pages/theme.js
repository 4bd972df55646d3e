// Light, dark, or as the system has it; remembered in this browser.

const REMEMBERED = "tsis-colours";
const CHOICES = [
  { name: "auto", label: "as the system", icon: "brightness_auto" },
  { name: "light", label: "light", icon: "light_mode" },
  { name: "dark", label: "dark", icon: "dark_mode" },
];

export default {
  template: `
    <q-btn flat dense round :icon="choice.icon" :aria-label="'Colours: ' + choice.label + '. Change to ' + next.label"
      @click="choose((at + 1) % 3)"><q-tooltip aria-hidden="true">Colours: {{ choice.label }}</q-tooltip></q-btn>`,
  data: () => ({ at: 0 }),
  computed: {
    choice() {
      return CHOICES[this.at];
    },
    next() {
      return CHOICES[(this.at + 1) % CHOICES.length];
    },
  },
  mounted() {
    this.system = matchMedia("(prefers-color-scheme: dark)");
    this.colour = () => {
      const name = this.choice.name;
      setDark(name === "auto" ? null : name === "dark");
      document.documentElement.classList.toggle("dark", name === "dark" || (name === "auto" && this.system.matches));
    };
    this.elsewhere = (event) => {
      if (event.key === REMEMBERED) this.recall();
    };
    this.system.addEventListener("change", this.colour);
    window.addEventListener("storage", this.elsewhere); // another tab of this browser has chosen
    this.recall();
  },
  unmounted() {
    this.system.removeEventListener("change", this.colour);
    window.removeEventListener("storage", this.elsewhere);
  },
  methods: {
    recall() {
      let name = null;
      try {
        name = localStorage.getItem(REMEMBERED);
      } catch {
        // storage is refused: as the system has it
      }
      this.at = Math.max(0, CHOICES.findIndex((choice) => choice.name === name));
      this.colour();
    },
    choose(at) {
      this.at = at;
      try {
        localStorage.setItem(REMEMBERED, this.choice.name);
      } catch {
        // it is forgotten with the page then
      }
      this.colour();
    },
  },
};
