"""Kinds of history: a form with a set of outlying runs. The grid lays a lattice for each (`lattice`)."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.tracking.courses import FORM_COURSE, FORM_SIZE, Course, form_of, log_form_weight
from models.tracking.criteria import OTHER_SIZES
from models.tracking.linear_model import log_outlying
from models.tracking.prior import Prior

#: Of each form the one that stands for it on the first lattice, which is so blurred that the law of the scatter and smaller
#: differences of q hardly matter there: a larger q's mass lies no less wide.
_FIRST_SIZES = np.where(
    FORM_COURSE == Course.EQ_6, FORM_SIZE, np.where(OTHER_SIZES[1] >= FORM_SIZE, OTHER_SIZES[1], OTHER_SIZES[-1])
)
_STANDS_FOR = form_of(FORM_COURSE, _FIRST_SIZES, np.zeros(FORM_SIZE.size, dtype=bool))
LAID_FIRST = np.unique(_STANDS_FOR)


@dataclass(frozen=True, slots=True, kw_only=True)
class Kinds:
    """k kinds of history: their form [k], which runs are outlying [k, t] (0, 1), log prior probability [k]."""

    form: NDArray[np.intp]
    outlying: FloatArray
    log_weight: FloatArray

    @classmethod
    def of(cls, prior: Prior, outlying: FloatArray, forms: NDArray[np.intp]) -> "Kinds":
        """Each of the forms that the prior has possible with each of the sets [c, t]."""
        weight = log_form_weight(prior)
        possible = forms[np.isfinite(weight[forms])]
        sets = np.repeat(outlying, possible.size, axis=0)
        return cls(
            form=np.tile(possible, outlying.shape[0]),
            outlying=sets,
            log_weight=np.tile(weight[possible], outlying.shape[0]) + log_outlying(prior, sets.T),
        )

    @property
    def size(self) -> FloatArray:
        """The size q of the discrepancy of every kind [k]."""
        return FORM_SIZE[self.form]

    @property
    def course(self) -> NDArray[np.intp]:
        """The course of every kind [k]."""
        return FORM_COURSE[self.form]

    def taken(self, index: NDArray[np.intp]) -> "Kinds":
        """The kinds at `index`."""
        return Kinds(**{field.name: getattr(self, field.name)[index] for field in fields(self)})


def represented(prior: Prior, laid: Kinds) -> tuple[Kinds, NDArray[np.intp]]:
    """All kinds, and which of those `laid` stands for each."""
    weight = log_form_weight(prior)
    groups = [np.flatnonzero((form == _STANDS_FOR) & np.isfinite(weight)) for form in laid.form.tolist()]
    index, form = np.repeat(np.arange(laid.form.size), [forms.size for forms in groups]), np.concatenate(groups)
    lean = weight[form] - weight[laid.form[index]]
    return Kinds(form=form, outlying=laid.outlying[index], log_weight=laid.log_weight[index] + lean), index
