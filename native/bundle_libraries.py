"""bundle_libraries.py WHEEL DIRECTORY: `auditwheel repair` where the C library is newer than any manylinux policy.

auditwheel knows the C libraries of the distributions that are out, and refuses to repair a wheel built on a newer one. The
libraries must get private names all the same (another libtbb.so.12 in the process would be taken for ours), so this does
its repair without the tag: the wheel stays linux_x86_64, which promises nothing to systems older than this one.
"""

import sys
from pathlib import Path

from auditwheel.architecture import Architecture
from auditwheel.libc import Libc
from auditwheel.patcher import ElfPatcher
from auditwheel.repair import repair_wheel
from auditwheel.wheel_abi import analyze_wheel_abi

wheel, directory = Path(sys.argv[1]), Path(sys.argv[2])
abi = analyze_wheel_abi(
    Libc.GLIBC, Architecture.detect(), wheel, frozenset(), disable_isa_ext_check=False, allow_graft=True
)
if abi.sym_policy != abi.policies.linux:
    sys.exit(f"{wheel.name} fits {abi.sym_policy.name}: auditwheel refused it for another reason, see above.")
newest = abi.policies.highest.name  # what is left out: only what every distribution has had
directory.mkdir(parents=True, exist_ok=True)
repair_wheel(
    abi,
    wheel,
    abis=[newest],
    lib_sdir=".libs",
    out_dir=directory,
    update_tags=False,
    patcher=ElfPatcher.get_patcher("patchelf", newest),
    strip=False,
    zip_compression_level=-1,
)
