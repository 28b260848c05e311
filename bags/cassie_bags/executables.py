"""The executables of the package, by name."""

from cassie_msgs.processes import entry_point

cassie_bags = entry_point("cassie_bags.__main__")
record = entry_point("cassie_bags.cli.record")
robot = entry_point("cassie_bags.cli.robot")
replay = entry_point("cassie_bags.cli.replay")
recover = entry_point("cassie_bags.cli.recover")
experiment = entry_point("cassie_bags.cli.experiment")
fingerprint = entry_point("cassie_bags.cli.fingerprint")
faults = entry_point("cassie_bags.cli.faults")
failsafes = entry_point("cassie_bags.cli.failsafes")
learn_torques = entry_point("cassie_bags.cli.learn_torques")
return_map = entry_point("cassie_bags.cli.return_map")
sweep = entry_point("cassie_bags.cli.sweep")
tune = entry_point("cassie_bags.cli.tune")
info = entry_point("cassie_bags.cli.info")
plot = entry_point("cassie_bags.cli.plot")
compare = entry_point("cassie_bags.cli.compare")
report = entry_point("cassie_bags.cli.report")
export = entry_point("cassie_bags.cli.export")
