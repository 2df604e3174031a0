in float depth;
out float nearest;

void main() {
    nearest = depth;
}
