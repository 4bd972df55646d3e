"""Studies of how well inclusions are found.

`tsis.study.folder.new_study` writes a folder with the plan, the sealed truth and the log. Readings come from the
virtual probe or from other devices (`tsis.study.readings`). `tsis.study.folder.unblind` happens once; no reading is
accepted after it. `tsis.study.analysis.analyse` compares the readings with the truth, and
`tsis.study.folder.verify_study` checks every file and the log.

The statistics have intervals that stay right for few targets: rates (`tsis.study.proportions`), curves
(`tsis.study.roc`), probabilities beside what came true (`tsis.study.probabilities`), agreement of raters and methods
(`tsis.study.agreement`), repeatability and linearity (`tsis.study.precision`). `tsis.study.card` and `tsis.study.drift`
watch a probe, `tsis.study.kit` is for a first physical validation, `tsis.study.classifier` names the kind of an
inclusion, and `tsis.study.search` says where to press to search an area, and what a plan cannot miss.
"""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.study import agreement as agreement
    from tsis.study import analysis as analysis
    from tsis.study import card as card
    from tsis.study import classifier as classifier
    from tsis.study import drift as drift
    from tsis.study import estimator as estimator
    from tsis.study import folder as folder
    from tsis.study import kit as kit
    from tsis.study import log as log
    from tsis.study import plan as plan
    from tsis.study import precision as precision
    from tsis.study import probabilities as probabilities
    from tsis.study import proportions as proportions
    from tsis.study import readings as readings
    from tsis.study import roc as roc
    from tsis.study import search as search
else:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=[
            *("agreement", "analysis", "card", "classifier", "drift", "estimator", "folder", "kit", "log", "plan"),
            *("precision", "probabilities", "proportions", "readings", "roc", "search"),
        ],
    )
