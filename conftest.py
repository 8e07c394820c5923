"""What this project asks of its own models, beyond that they agree.

The validation itself is `pytest --crosscheck models`: every built-in model in every engine and
scenario.
"""

# Here too where the package is not installed.
pytest_plugins = ["pytest_crosscheck"]

BAR = 1e-10


def pytest_crosscheck_case(record):
    """Ten digits; the claimed orders; steps that hold what they promise; energy and constraints."""
    demands = []
    for name in ("discrepancy", "uncertainty"):
        if record[name] > BAR:
            demands.append(f"its {name} is {record[name]:.1e}, above {BAR:.0e}")
    claimed = record["claimed_order"]
    if not record["raw_order"] > claimed - 0.3:
        demands.append(f"plain runs have order {record['raw_order']}, {claimed} is claimed")
    if not abs(record["order"] - claimed) < 0.3:
        demands.append(f"the segments' order is {record['order']}, {claimed} is claimed")
    checked = record["checked_step"]
    # No step is told for motions too sensitive for one, nor run where it would take too long.
    if not checked and record["system"] != "drum_pendulum" and record["scenario"] != "large":
        demands.append("no step was told and run")
    if checked and not 0.3 * checked["target"] < checked["measured"] < 1.3 * checked["target"]:
        demands.append(f"the step told for {checked['target']:g} gave {checked['measured']:g}")
    if not record["energy_error"] < 0.2:
        demands.append(f"energy is out of balance by {record['energy_error']:.2g}")
    drift = record["constraint_drift"]
    if not drift < 0.05:
        demands.append(f"constraints drift by {drift:.2g}")
    held = {("mujoco_rolling.xml", "mujoco"), ("robot.urdf", "pybullet")}
    rolls = record["system"] == "drum_pendulum" and (record["model"], record["engine"]) in held
    if rolls and not drift > 0:
        demands.append("the drum is not held by a constraint")
    return demands
