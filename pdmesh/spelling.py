"""Names that were meant by what was typed: by their meaning, or else by their letters."""

from __future__ import annotations

from collections.abc import Iterable

ALIKE = 0.65  # words that are no less similar are taken for the same one misspelt
CLOSE = 0.8  # names with paths that are no less similar, and other words for a name: one word of them is misspelt
SHORTEST = 5  # letters of another word that is meant where it is misspelt: field is no misspelt file

# What other programs and books call our keys, options and values; spaces, hyphens and capitals do not matter
OTHER_NAMES = {
    "E": ("young", "youngs modulus", "youngs", "elastic modulus", "modulus", "emod", "stiffness modulus"),
    "nu": ("poisson", "poissons ratio", "poisson ratio", "v"),
    "rho": ("density", "mass density", "dens"),
    "G0": ("toughness", "Gc", "GIc", "Gf", "fracture energy", "fracture toughness", "energy release rate"),
    "critical_stretch": ("s0", "sc", "s_crit", "stretch", "critical strain"),
    "f_t": ("tensile strength", "ft", "strength", "sigma_t"),
    "strength": ("tensile strength", "f_t", "ft", "sigma_t", "critical stress"),
    "yield_stress": ("sigma_y", "yield strength", "fy", "yield"),
    "hardening": ("hardening modulus", "H"),
    "alpha": ("thermal expansion", "expansion", "cte", "expansion coefficient"),
    "T0": ("reference temperature", "temperature", "tref"),
    "D": ("diffusivity", "diffusion coefficient"),
    "friction": ("mu", "friction coefficient"),
    "time_step": ("dt", "step size", "timestep", "delta t"),
    "duration": ("end time", "t_end", "tmax", "total time", "final time", "time"),
    "steps": ("number of steps", "nsteps", "n_steps", "increments", "nt"),
    "load_steps": ("increments", "load increments", "nload"),
    "every": ("interval", "output interval", "output every", "frequency", "stride", "dump"),
    "tolerance": ("tol", "convergence"),
    "iterations": ("maxiter", "max iterations"),
    "ratio": ("m", "horizon ratio", "delta over dx"),
    "horizon": ("delta", "radius"),
    "spacing": ("dx", "h", "grid spacing", "mesh size", "resolution", "element size"),
    "adapt": ("adaptivity", "amr", "refinement"),
    "damping": ("alpha", "c", "viscosity"),
    "output": ("out", "outfile", "file", "save"),
    "force": ("overwrite", "yes"),
    "threads": ("cores", "nthreads", "np", "jobs", "cpus", "num threads", "nproc"),
    "resume": ("restart", "continue"),
    "static": ("quasistatic", "quasi static", "implicit static", "steady", "equilibrium"),
    "explicit": ("dynamic", "verlet", "transient"),
    "quiet": ("silent", "s"),
    "device": ("gpu", "opencl", "cuda"),
    "trust": ("unsafe", "allow"),
    "fields": ("outputs", "output fields", "variables"),
    "frame": ("increment", "state", "snapshot"),
    "window": ("xlim", "ylim", "zoom", "crop", "extent", "bbox"),
    "largest": ("vmax", "clim", "limit", "max", "cmax"),
    "rate": ("fps", "framerate"),
    "cmap": ("colormap", "colourmap"),
    "size": ("font size", "fontsize"),
    "figsize": ("figure size", "size"),
    "csv": ("table", "data"),
    "dry-run": ("estimate", "plan", "check"),
    "settings": ("config", "input", "parameters"),
    "bond": ("bond based", "bb", "pmb"),
    "ordinary": ("state", "state based", "osb", "lps", "ordinary state based"),
    "correspondence": ("nosb", "non ordinary", "non ordinary state based"),
    "j2": ("plastic", "von mises", "elastoplastic"),
    "brittle": ("linear", "elastic", "prototype", "pmb"),
    "neo hooke": ("neohookean", "neo hookean"),
    "orthotropic": ("anisotropic", "ply", "lamina", "composite", "fibre", "fiber", "transversely isotropic"),
    "svk": ("st venant kirchhoff", "saint venant"),
}


def nearest(name: str, names: Iterable[str], cutoff: float = 0.0) -> str:
    """The most similar of these `names`; "" if none has at least the similarity `cutoff`, from 0 to 1.

    Of names that are equally similar, such as those of several axes, the first by alphabet.
    """
    import difflib  # where something is wrong alone

    lower = {candidate.lower(): candidate for candidate in sorted(names, reverse=True)}
    matcher = difflib.SequenceMatcher(b=name.lower())
    best, most = "", cutoff
    for candidate in sorted(lower, reverse=True):
        matcher.set_seq1(candidate)
        if (similarity := matcher.ratio()) >= most:
            best, most = lower[candidate], similarity
    return best


def meant(name: str, known: Iterable[str], cutoff: float = ALIKE) -> str:
    """The one of the `known` names that `name` stands for: the same name, another word for it, or a similar one.

    Names may have a path before them, such as ``material.E``, ``Peridynamics/Material/E`` or ``--frame``; a word for
    its last part is enough. "" if there is none.
    """
    every = list(known)
    word = _plain(_last(name))
    same = [other for other in every if _plain(_last(other)) == word]
    names = {_plain(own) for own, others in OTHER_NAMES.items() if word in map(_plain, others)}
    by_meaning = [other for other in every if _plain(_last(other)) in names]
    folder = _plain(name)[: -len(word)] if word else ""
    if not folder:
        return (same or by_meaning or [_by_letters(word, every, cutoff)])[0]
    beside = [other for other in (*same, *by_meaning) if _plain(other)[: -len(_plain(_last(other)))] == folder]
    if beside:
        return nearest(name, beside)
    return nearest(name, every, CLOSE) or nearest(name, same or by_meaning) or nearest(name, every, cutoff)


def _by_letters(word: str, known: list[str], cutoff: float) -> str:
    """The one of the `known` names whose last part, or else another word for it, is most similar to `word`."""
    words = {_plain(_last(other)): other for other in reversed(known)}
    others = {
        _plain(other): words[_plain(own)]
        for own, every in OTHER_NAMES.items()
        for other in every
        if _plain(own) in words and len(_plain(other)) >= SHORTEST
    }
    return words.get(nearest(word, words, cutoff)) or others.get(nearest(word, others, max(cutoff, CLOSE)), "")


def _last(name: str) -> str:
    return name.replace("/", ".").rsplit(".", 1)[-1]


def _plain(name: str) -> str:
    """A name without what people write differently."""
    return "".join(sign for sign in name if sign.isalnum()).lower()
