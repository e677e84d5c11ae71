"""Example of reading the table of a run, steps.parquet, with pandas and with polars."""

import subprocess
import sys

import pandas as pd
import polars as pl

command = [sys.executable, "-m", "servo", "run", "circle", "--quiet", "--out", "circle"]
subprocess.run([*command, "--set", "run.duration=1.0", "--set", "expect={}"], check=True)

steps = pd.read_parquet("circle/steps.parquet")
print(f"pandas: {steps.servo_error_px.abs().max():.2f} px at most in {len(steps)} pictures")
late = pl.scan_parquet("circle/steps.parquet").filter(pl.col("time_s") >= 0.5)
print(f"polars: {late.select(pl.col('servo_error_px').mean()).collect().item():.2f} px on average")
