"""Words of other programs, under which the search finds the pages of this one."""

from __future__ import annotations

WORDS = {
    "getting-started": "install pip conda Windows quick start resume exit status cache read result",
    "tutorials/python": "Jupyter notebook Python API interface numpy pandas interactive script",
    "tutorials/taylor-bar": "Taylor test copper bar impact validation calibration friction",
    "tutorials/failures": "wrong result instability locking noise fracture energy loss learn",
    "tutorials/slope": "retaining wall earth pressure active passive landslide blade restart",
    "tutorials/own-law": "own material law energy formula rubber Treloar fit calibrate plug-in",
    "choose": "recommendation best method landslide slope impact crash fluid soil metal for",
    "messages/index": "error stop stopped crash ended abort failed reason time step too large",
    "methods": "shape functions kernel particle grid transfer APIC MLS FLIP PIC time step",
    "materials": "constitutive model law plasticity elasticity soil metal fluid anisotropic spall",
    "units": "unit system consistent SI mm",
    "versions": "cite citation paper reference",
    "many-processes": "MPI parallel cluster Slurm srun mpiexec OpenMP threads GPU scaling resume",
    "needs": "dry run validate preview memory estimate time step check",
    "studies": "parameter study optimisation sensitivity batch",
    "studies/sweep": "parameter sweep variation batch of runs table design of experiments",
    "studies/chart": "plot error cost order of convergence Pareto compare curves",
    "studies/sampling": "uncertainty Monte Carlo random probability reliability Sobol Morris",
    "studies/elsewhere": "cluster Dask Slurm PBS MPI pool distributed batch array job",
    "studies/fit": "calibrate calibration inverse least squares parameter identification",
    "studies/advise": "cheapest set-up accuracy target optimisation which mesh size",
    "studies/find": "bisection factor of safety limit load critical value root threshold",
    "studies/stability": "stable time step map Courant unstable limit",
    "studies/live": "monitor progress browser dashboard watch",
    "energy": "conservation drift energy error instability blow up gain loss",
    "failures": "instability blow up numerical fracture locking hourglass cell crossing null space",
    "howto/boundary": "symmetry plane symmetric half quarter prescribed displacement",
    "howto/time-step": "mass scaling density scaling quasi-static explicit faster",
    "implicit": "static quasi-static Newton solver load step equilibrium Newmark large time step",
    "script": "input file syntax variable loop if include language deck",
    "plugins": "extension user subroutine UMAT VUMAT custom Python hook own user material law",
    "reference/columns": "output field variable stress strain velocity history von Mises",
    "reference/generated/command/restart": "resume continue checkpoint save state crash recover",
    "reference/generated/command/read_restart": "resume continue checkpoint load state initial",
    "reference/generated/command/write_restart": "resume continue checkpoint save state",
    "reference/generated/command/dt_factor": "time step too large Courant CFL unstable smaller",
    "reference/generated/command/set_dt": "time step too large Courant CFL fixed constant timestep",
    "reference/generated/command/boundary": "boundary condition edge of domain outflow",
    "reference/generated/command/units": "units SI mm unit system conversion",
    "reference/generated/command/anti_volumetric_locking": "B-bar F-bar locking incompressible",
    "reference/generated/command/dump": "output export save results VTK ParaView OVITO HDF5",
    "reference/generated/command/set_output": "thermo log interval print frequency",
    "reference/generated/command/delete_particles": "remove hole excavation construction stage",
    "reference/generated/fix/velocity_nodes": "boundary condition hold wall support Dirichlet",
    "reference/generated/fix/body_force": "gravity self own weight acceleration centrifugal load",
    "reference/generated/fix/edge_traction": "boundary condition Neumann surface load traction",
    "reference/generated/fix/edge_pressure": "boundary condition Neumann pressure surface load",
    "reference/generated/fix/local_damping": "damping dynamic relaxation rest equilibrium viscous",
    "reference/generated/fix/erosion": "element deletion damage remove broken failure",
    "reference/generated/fix/initial_stress": "initial in-situ stress prestress",
    "reference/generated/fix/geostatic_stress": "initial in-situ stress weight at rest K0",
    "reference/generated/fix/python": "user subroutine callback function hook",
    "reference/generated/dump/vtk": "VTK export ParaView VTU PVD visualisation",
    "reference/generated/dump/grid-vtk": "VTK export ParaView grid nodes visualisation",
    "reference/generated/dump/movie": "make animation film video gif mp4 visualisation",
    "reference/generated/dump/pyplot": "figure image picture plot png visualisation",
    "reference/generated/eos/jwl": "explosion explosive blast detonation TNT burn",
    "reference/generated/material/rigid": "rigid body tool indenter obstacle",
    "reference/generated/scheme/quasi-static": "static equilibrium Newton implicit load step",
}

# Of questions as people write them, which the search would look for too.
ASKED = "how do does can i we my me you what which where why run use make it"

ASKED_OF = ("choose", "getting-started", "messages/index", "tutorials/python", "units", "versions")


def add_words(app, doctree) -> None:
    """Put the words of a page where the search indexes them, and nobody sees them.

    The search takes what stands between commas as one word; those of the head of a page, too.
    """
    from docutils import nodes  # tests read WORDS, and have no docutils

    name = app.env.docname
    words = WORDS.get(name, "")
    if name.startswith("howto/") or name in ASKED_OF:
        words = f"{words} {ASKED}"
    if words:
        doctree.insert(0, nodes.meta(name="keywords", content=words))
    for node in doctree.findall(nodes.meta):
        if node.get("name") == "keywords":
            node["content"] = ", ".join(node["content"].lower().replace(",", " ").split())


def check_pages(app, env) -> list[str]:
    """Refuse words for a page that does not exist."""
    missing = sorted(set(WORDS) - env.found_docs)
    if missing:
        raise ValueError(f"docs/_ext/synonyms.py names pages that do not exist: {missing}")
    return []


def setup(app):
    """Add the words after a page is read."""
    app.connect("doctree-read", add_words)
    app.connect("env-updated", check_pages)
    return {"parallel_read_safe": True}
