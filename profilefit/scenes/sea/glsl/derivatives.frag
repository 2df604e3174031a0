// Light by the lengths of two derivatives, as many shaders have it: no area where they are not at right angles.
in vec2 old_place;
in float flux;
out float deposit;

void main() {
    deposit = flux * length(dFdx(old_place)) * length(dFdy(old_place));
}
