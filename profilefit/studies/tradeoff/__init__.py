"""Speed against accuracy, measured in one run: of truths, laws, samplers and fits."""
