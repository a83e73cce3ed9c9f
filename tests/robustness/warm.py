"""What the process that forks for every command has loaded and compiled once."""

from importlib import import_module

from fdnet.network.warm_up import warm_up

for name in ("fdnet.run.pipeline", "fdnet.report.figures", "fdnet.report.html"):
    import_module(name)
warm_up("yz")
