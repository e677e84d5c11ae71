"""Write down the settings of a benchmark before its public worlds are run: python tests/tools/freeze.py NAME."""

import json
import sys
from pathlib import Path

from servo.bench.benchmark import load

benchmark = load(sys.argv[1])
found = {"settings": benchmark.settings(), "rendering": ""}
path = Path("scenes/benchmarks") / f"{benchmark.name}.json"
path.write_text(json.dumps(found, indent=1, sort_keys=True) + "\n")
sys.stdout.write(f"{path} {load(benchmark.name).hash}\n")
