"""Validates a unit and simulates it with FMPy: simulate.py UNIT INPUTS.csv EXPECTED.csv STEP_S [NAME=VALUE]...

Prints the problems found and, for each column of EXPECTED.csv, the largest difference, as JSON.
"""

import json
import sys

import numpy as np
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

unit, inputs, expected, step_s, *start = sys.argv[1:]
problems = [str(p) for p in validate_fmu(unit)]
inputs = np.genfromtxt(inputs, delimiter=",", names=True, deletechars="")
expected = np.genfromtxt(expected, delimiter=",", names=True, deletechars="")
names = list(expected.dtype.names)
result = simulate_fmu(
    unit, start_time=0.0, stop_time=float(inputs["time"][-1]), output_interval=float(step_s), input=inputs, output=names,
    start_values=dict(pair.split("=") for pair in start), validate=False,
)
apart = {name: float(np.max(np.abs(result[name][1:] - expected[name][1 : len(result)]))) for name in names}
print(json.dumps({"problems": problems, "samples": len(result), "apart": apart}))
