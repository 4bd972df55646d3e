"""Every figure and table of the source that shows a result, in its order."""

from __future__ import annotations

from typing import TYPE_CHECKING

from studies import (
    figure_4_7,
    figure_5_21,
    figure_6_23,
    figures_3_4_to_3_6,
    figures_3_9_and_3_10,
    figures_5_14_to_5_18,
    figures_5_19_and_5_20,
    figures_6_4_to_6_15,
    figures_6_18_to_6_22,
    force_line,
    hardness_printed,
    printed_6_4,
    table_4_1,
    table_6_2,
)

if TYPE_CHECKING:
    from studies.shown import Shown

SHOWN: tuple[Shown, ...] = (
    *printed_6_4.SHOWN,
    *figures_3_4_to_3_6.SHOWN,
    *figures_3_9_and_3_10.SHOWN,
    *figure_4_7.SHOWN,
    *table_4_1.SHOWN,
    *force_line.SHOWN,
    *figures_5_14_to_5_18.SHOWN,
    *figures_5_19_and_5_20.SHOWN,
    *figure_5_21.SHOWN,
    *hardness_printed.SHOWN,
    *figures_6_4_to_6_15.SHOWN,
    *figures_6_18_to_6_22.SHOWN,
    *table_6_2.SHOWN,
    *figure_6_23.SHOWN,
)
