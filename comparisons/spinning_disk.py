"""Disk that spins freely: angular momentum and energy after a turn."""

from __future__ import annotations

from comparisons.row import Row

SMALL = None  # tests of its own (tests/test_verification.py)


def compare(run, axes, full):
    """APIC keeps angular momentum, FLIP nearly, PIC does not (Jiang et al. 2015)."""
    for transfer, alpha, within in (("APIC", "mechanical", 1e-8), ("FLIP", 1, 0.05)):
        log = run(transfer=transfer, alpha=alpha).log
        kept = log.Lz_z[-1] / log.Lz_z[0]
        yield Row(f"angular momentum kept, {transfer}", 1.0, kept, within, "exact")
        energy = log.Ek + log.Es
        yield Row(f"energy kept, {transfer}", 1.0, energy[-1] / energy[0], 0.03, "exact")
        axes.plot(log.Time, log.Lz_z / log.Lz_z[0], lw=1, label=transfer)
    axes.set(xlabel="time", ylabel="angular momentum / first")
