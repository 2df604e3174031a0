"""Error against the number of samples."""

from tests.unit.scenes.toy.passes import faded


def over_samples(renderer, judge, of, numbers):
    def draw(samples):
        return renderer.image(faded(of.k, of.size, samples))[..., :3]

    return judge.points("toy", numbers, draw, lambda samples: renderer.time(faded(of.k, of.size, samples)), 2)
