"""The array script on a real Slurm of one node, started here where that is possible."""

import os
import shutil
import socket
import subprocess
import sys
import time

import pytest

from fdnet.campaign.engine.slurm import RUNS, SUBMIT, write_slurm_scripts
from fdnet.campaign.engine.tasks import HowToRun, Task
from fdnet.errors import CaseError

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "sinfo")
CONFIGURATION = """ClusterName=fdnet
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
SlurmctldPort=16817
SlurmdPort=16818
AuthType=auth/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SchedulerParameters=sched_interval=1,batch_sched_delay=0
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} State=UNKNOWN
PartitionName=all Nodes={host} Default=YES State=UP
"""


def ready(environment: dict[str, str], seconds: float) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        answer = subprocess.run(["sinfo", "-h", "-o", "%t"], env=environment, capture_output=True)
        if answer.stdout.strip() == b"idle":
            return True
        time.sleep(0.5)
    return False


@pytest.fixture
def slurm(tmp_path_factory):
    """The environment in which sbatch talks to a Slurm of this machine alone."""
    missing = [name for name in PROGRAMS if shutil.which(name) is None]
    if missing:
        pytest.skip(f"Slurm is not installed: no {', '.join(missing)} on PATH")
    if os.geteuid() != 0:
        pytest.skip("Slurm is only started here by root")
    if subprocess.run(["munge", "-n"], capture_output=True).returncode:
        pytest.skip("munged is not running; start it with: su -s /bin/sh munge -c munged")
    folder = tmp_path_factory.mktemp("slurm")
    (folder / "state").mkdir()
    host = socket.gethostname().split(".")[0]
    text = CONFIGURATION.format(folder=folder, host=host, cores=os.cpu_count())
    (folder / "slurm.conf").write_text(text)
    environment = os.environ | {"SLURM_CONF": str(folder / "slurm.conf")}
    started = [
        subprocess.Popen([name, "-D"], env=environment, stdout=-3, stderr=-3)
        for name in ("slurmctld", "slurmd")
    ]
    try:
        if not ready(environment, 20):
            pytest.skip(f"Slurm did not start; see {folder}/slurmctld.log and slurmd.log")
        yield environment
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait(20)


def test_packs_come_before_runs_and_a_failing_job_stops_nothing(slurm, tmp_path):
    (tmp_path / "logs").mkdir()
    make = "import time; time.sleep(6); open('pack', 'w').write('made')"
    copy = "open('{0}', 'w').write(open('pack').read())"
    tasks = [
        Task(name="pack-1", words=(sys.executable, "-c", make), makes="pack"),
        Task(name="bad", words=(sys.executable, "-c", "raise SystemExit('no good')"), makes="x"),
        *(
            Task(name=name, words=(sys.executable, "-c", copy.format(name)), makes=name)
            for name in ("one", "two")
        ),
    ]
    how = HowToRun(jobs=2, resources=("time=2",))
    write_slurm_scripts(tmp_path, "test", tasks, how, ranks=1)
    subprocess.run(["bash", str(tmp_path / SUBMIT)], env=slurm, check=True, capture_output=True)
    end = time.monotonic() + 60
    files = [tmp_path / "one", tmp_path / "two", tmp_path / "logs/bad.txt"]
    while time.monotonic() < end and not all(f.exists() and f.stat().st_size for f in files):
        time.sleep(0.5)
    assert [f.read_text() for f in files] == ["made", "made", "no good\n"]


SBATCH = """#!/bin/bash
# Stands for sbatch: keeps its words, and runs every job of the array.
for word in "$@"; do echo "$word" >> words.txt; script=$word; done
for job in 0 1; do SLURM_ARRAY_TASK_ID=$job bash "$script" </dev/null >&2; done
echo 7
"""
HIT = "touch hit"


@pytest.mark.parametrize(
    "folder",
    ["a b", f"a;{HIT};", f"$({HIT})", f"`{HIT}`", f"a\n{HIT}\n", "it's", f'"; {HIT} "', "-x"],
)
def test_nothing_that_a_user_names_is_run_by_the_scripts(tmp_path, folder):
    """The scripts are carried out with a stand-in for sbatch: each job runs, and nothing else."""
    out = tmp_path / folder
    (out / "logs").mkdir(parents=True)
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "sbatch").write_text(SBATCH)
    (tmp_path / "bin" / "sbatch").chmod(0o755)
    write = "import sys; open('made-' + sys.argv[1][0], 'w').write(sys.argv[1])"
    words = [f"0 $({HIT}) ; {HIT} '\n{HIT}", f'1 `{HIT}` && {HIT} " | {HIT}']
    tasks = [
        Task(name=f"job-{word[0]}", words=(sys.executable, "-c", write, word), makes="x")
        for word in words
    ]
    how = HowToRun(jobs=2, resources=(f"comment=a; {HIT} $({HIT})", "--time=2", "exclusive"))
    write_slurm_scripts(out, f"tiny\n{HIT}", tasks, how, ranks=1)
    path = f"{tmp_path / 'bin'}:{os.environ['PATH']}"
    subprocess.run(
        ["bash", str(out / SUBMIT)], cwd=tmp_path, env=os.environ | {"PATH": path}, check=True
    )
    assert not list(tmp_path.rglob("hit"))
    assert [(out / f"made-{number}").read_text() for number in range(2)] == words
    assert (out / "words.txt").read_text().split() == ["--parsable", "runs.sbatch"]
    given = [line for line in (out / RUNS).read_text().splitlines() if line.startswith("#SBATCH")]
    assert f"#SBATCH --comment='a; {HIT} $({HIT})'" in given
    assert {"#SBATCH --time=2", "#SBATCH --exclusive"} <= set(given)
    lines = (out / RUNS).read_text().splitlines()
    assert lines[len(given) + 2].startswith("# A job that was cut")


@pytest.mark.parametrize(
    "option", ["a\nb", "comment='x", 'x="', "$(x)", "=3", "time=\\x", "a b=1"]
)
def test_an_option_that_sbatch_could_misread_is_refused(tmp_path, option):
    task = Task(name="one", words=("true",), makes="x")
    how = HowToRun(jobs=1, resources=(option,))
    with pytest.raises(CaseError, match=r"--slurm-script: .*expected options of sbatch"):
        write_slurm_scripts(tmp_path, "test", [task], how, ranks=1)
