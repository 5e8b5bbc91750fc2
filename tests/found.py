"""Made-up findings of every severity and status, for tests of what shows them."""

from dataclasses import replace

from kinertia.findings.finding import Severity, finding, with_evidence
from kinertia.findings.quantity import Quantity, Where

ALONG_Z = {"axis": "mediolateral", "file_axis": "Z"}
ZERO = finding(
    "P213",
    Where(trial="walk", plate="plate 1", axis="vertical", file_axis="Y"),
    level_n=Quantity(-23.1, "N", limit=15.0, usual=(-3.0, 3.0)),
)
UNEXPLAINED = finding("P214", Where(trial="walk", plate="plate 1"), force_n=Quantity(22.0, "N")).muted("P213")
FROZEN = [
    finding("M113", Where(trial="walk", markers=(label,), span_s=(1.2, 1.7)), longest_s=Quantity(0.5, "s", limit=0.2))
    for label in ("LANK", "LTOE")
]
CLEAR = {"moved": Quantity(2.3, "1", limit=1.0), "kind": Quantity("a clear"), "condition": Quantity("")}
CORRECTED = [
    with_evidence(
        "P215",
        Where(trial="walk", plate="plate 1", **ALONG_Z),
        {"zero_offset_n": Quantity(6.5, "N", usual=(-2.4, 2.4), sd=0.9), **CLEAR},
    ),
    with_evidence("T214", Where(), {"delay_s": Quantity(0.0071, "s", sd=0.0006), **CLEAR}),
]
ASSUMED = finding("R111", Where(trial="walk"), cutoff_hz=Quantity(6.0, "Hz"))
WAIVED = replace(
    finding("P244", Where(trial="walk", plate="plate 2"), distance_m=Quantity(0.062, "m", limit=0.04)), status="waived"
)
IGNORED = replace(finding("M102", Where(trial="walk", markers=("C7",)), share=Quantity(0.4, "1")), status="ignored")
RESIDUAL = finding(
    "R301",
    Where(trial="walk"),
    Severity.ERROR,
    rms_n=Quantity(12.3, "N", limit=10.0),
    peak_n=Quantity(41.0, "N", limit=25.0),
    full_rms_n=Quantity(20.1, "N"),
    full_peak_n=Quantity(80.0, "N"),
)
FAULT_FREE = (*CORRECTED, ASSUMED)
FAULTY = (*FAULT_FREE, ZERO, UNEXPLAINED, *FROZEN, WAIVED, IGNORED)
UNUSABLE = (*FAULTY, RESIDUAL)
