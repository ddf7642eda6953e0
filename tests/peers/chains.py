"""Compiles the articulated-body algorithm of Pinocchio for `cargo xtask bench scaling --peers`.

    chains.py <folder> <instruction set>

Pinocchio's wheel has its headers, and those of Boost; Eigen's are in the wheel cmeel-eigen. Everything is compiled from
headers, for the instruction set that hamel's modules are compiled for: nothing is called through Python, and nothing of
the wheel's own libraries is. `chains.cpp` is the program, `chains` in the folder what it becomes.
"""

import importlib.metadata
import os
import pathlib
import shutil
import subprocess
import sys

FLAGS = ["-std=c++17", "-O3", "-DNDEBUG", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math"]
# As Pinocchio's own build files have it.
LIMITS = ["-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30",
          "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", "-DBOOST_FUSION_INVOKE_MAX_ARITY=12"]


def main():
    folder, cpu = pathlib.Path(sys.argv[1]), sys.argv[2]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        version = importlib.metadata.version("pin")
        eigen = importlib.metadata.version("cmeel-eigen")
    except importlib.metadata.PackageNotFoundError as error:
        sys.exit(f"{error.name} is not installed")
    compiler = os.environ.get("CXX") or shutil.which("g++") or shutil.which("clang++")
    if compiler is None:
        sys.exit("no compiler of C++ is in the path")
    include = next(p for p in map(pathlib.Path, sys.path) if (p / "cmeel.prefix/include/pinocchio").is_dir())
    include = include / "cmeel.prefix/include"
    print("work 1 compiling", flush=True)
    march = [] if cpu == "baseline" else [f"-march={cpu}"]
    source = pathlib.Path(__file__).with_name("chains.cpp")
    command = [compiler, *FLAGS, *LIMITS, *march, "-isystem", str(include), "-isystem", str(include / "eigen3"),
               str(source), "-o", str(folder / "chains")]
    # A minute or two, unless it was done before.
    built, made_of = folder / "chains.built", "\n".join([*command, version, eigen, source.read_text()])
    if not built.exists() or built.read_text() != made_of:
        outcome = subprocess.run(command, capture_output=True, text=True, check=False)
        if outcome.returncode:
            print(outcome.stderr[:4000], file=sys.stderr)
            sys.exit(f"{compiler} does not compile chains.cpp")
        built.write_text(made_of)
    print("round")
    said = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=True).stdout
    print(f"using Pinocchio {version} (Eigen {eigen})")
    print(f"using {said.splitlines()[0]}")


if __name__ == "__main__":
    main()
