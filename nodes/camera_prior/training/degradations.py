"""Pictures that must not be believed. Each family maps (rng, bank, road, photographs) to an RGB uint8 picture.

`SEEN` families are shown in training with uniform targets; `UNSEEN` families exist for the test alone.
`road` is a rendered road picture (size, size, 3); `photographs` maps a folder's name to its pictures.
"""

import degradations_test
import degradations_training

SEEN = {f.__name__: f for f in degradations_training.FAMILIES}
UNSEEN = {f.__name__: f for f in degradations_test.FAMILIES}
