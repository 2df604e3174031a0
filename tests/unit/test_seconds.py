"""A file of tests that takes too long fails the run that has a budget; a slow test in it does not count."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

BURNS = """
import time
import pytest

def burn():
    start = time.process_time()
    while time.process_time() < start + 0.4:
        pass

{mark}
def test_it():
    burn()
"""


@pytest.mark.parametrize(("mark", "budget", "status"), [("", 0.3, 1), ("", 30, 0), ("@pytest.mark.slow", 0.3, 0)])
def test_over_its_budget_a_file_fails_the_run(tmp_path, mark, budget, status):
    (tmp_path / "test_burns.py").write_text(BURNS.format(mark=mark))
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = slow: here, too\n")
    words = ["-m", "pytest", "-p", "tests.seconds", "-p", "no:cacheprovider", "-n", "1", "--budget", str(budget)]
    where = {"cwd": tmp_path, "env": {**os.environ, "PYTHONPATH": str(ROOT)}}
    done = subprocess.run([sys.executable, *words], **where, capture_output=True, text=True, timeout=120)
    assert done.returncode == status, done.stdout
    assert "1 passed" in done.stdout
    assert ("test_burns.py: 0." in done.stdout) == bool(status)
