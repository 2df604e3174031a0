// A law as the page tells it: its text at an index n of the surface.
const WORDS = /([\s;]+)/; // as in fragment.py

class Law {
  // told: of fragment.py, but that texts are places in `lines`; indices: n of the words
  constructor(told, lines, indices) {
    const whole = (places) => places.map((place) => lines[place]).join("\n");
    Object.assign(this, told, { indices, text: whole(told.text) });
    if (this.refracting) this.refracting = { ...this.refracting, text: whole(this.refracting.text) };
  }

  follows(n) {
    return n === 1 || Boolean(this.refracting);
  }

  // That of n = 1, where there is none of n.
  textAt(n) {
    if (n === 1 || !this.refracting) return this.text;
    const { text, places, words } = this.refracting, pieces = text.split(WORDS), own = words[this.indices.indexOf(n)];
    places.forEach((place, i) => { pieces[place] = own[i]; });
    return pieces.join("");
  }

  labelAt(n) {
    return this.follows(n) ? this.label : `n = 1: ${this.label}`;
  }
}
