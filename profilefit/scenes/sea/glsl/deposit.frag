// The same light for each fragment of a shape.
flat in float light;
out float deposit;

void main() {
    deposit = light;
}
