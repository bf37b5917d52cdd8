"""The measurement model of tracking written out as one multivariate normal: slow, and apart from `models.tracking`."""

import math

import numpy as np
from scipy.integrate import cumulative_trapezoid

from models.tracking.linear_model import EvaluationPoints
from models.tracking.measurement import Measurement
from models.tracking.prior import TrackPrior


def integrated(progress: np.ndarray) -> np.ndarray:
    """Covariance of δ with q · size = 1, by summing up its definition: curvature constant on sixths of the span,
    independent between them, integrated twice over fine cells."""
    edges = np.linspace(0.0, 1.0, 6_001)
    middles = 0.5 * (edges[1:] + edges[:-1])
    courses = []
    for stretch in range(6):
        curvature = np.where(np.floor(6.0 * middles) == stretch, math.sqrt(18.0), 0.0)
        slope = np.concatenate([[0.0], np.cumsum(curvature) / 6_000])
        course = cumulative_trapezoid(slope, edges, initial=0.0)
        courses.append(np.interp(progress / max(progress.max(), 1e-300), edges, course))
    return np.array(courses).T @ np.array(courses)


def normal(
    prior: TrackPrior, measurements: list[Measurement], points: EvaluationPoints
) -> tuple[np.ndarray, np.ndarray]:
    """Mean [n, t] and covariance [n, t, t] of the measurements at n points, all linear terms integrated out."""
    columns = (np.array([getattr(m, name) for m in measurements], dtype=float) for name in NAMES)
    progress, variance, epoch, new_levels = columns
    signs = np.array([(1, 1), (-1, -1), (1, -1), (-1, 1), (1, 1), (1, 1)], dtype=float)[points.course]
    growth = np.maximum(1.0 + progress * signs[:, :1] * np.exp(-points.log_scale)[:, None], 1e-12)
    grown = np.minimum(-signs[:, 1:] * np.exp(points.log_exponent)[:, None] * np.log(growth), math.log(1e3))
    b = signs.prod(axis=1)[:, None] * (1.0 - np.exp(grown))
    exponential = 1.0 - np.exp(-progress * np.exp(-points.log_scale)[:, None])
    b = np.where((points.course == 4)[:, None], exponential, b)
    b = np.where((points.course == 5)[:, None], np.log1p(progress * np.exp(-points.log_scale)[:, None]), b)
    size = max(abs(prior.initial_mean), prior.initial_sd)
    noise = variance + (1e-6 * math.hypot(prior.initial_sd, prior.change_sd)) ** 2
    value = np.array([m.value for m in measurements])
    growth = np.where((points.form >= 24)[:, None], np.maximum(np.square(value / size), 0.01), 1.0)
    noise = (
        noise + growth * np.exp(2 * points.log_scatter)[:, None] + points.outlying.T * (prior.outlying_size * size) ** 2
    )
    covariance = prior.initial_sd**2 + prior.change_sd**2 * b[:, :, None] * b[:, None, :]
    covariance += noise[:, :, None] * np.eye(progress.size)
    covariance += (points.size * size)[:, None, None] ** 2 * integrated(progress)
    for begun in np.unique(epoch)[1:]:
        after = (epoch >= begun).astype(float)
        new = new_levels[epoch == begun].max() > new_levels[epoch < begun].max()
        covariance += ((0.3 if new else prior.step_size) * size) ** 2 * np.outer(after, after)
    return prior.initial_mean + prior.change_mean * b, covariance


NAMES = ("progress", "variance", "epoch", "new_levels")


def log_likelihood(prior: TrackPrior, measurements: list[Measurement], points: EvaluationPoints) -> np.ndarray:
    """Log probability of the measurements at n points [n]."""
    mean, covariance = normal(prior, measurements, points)
    value = np.array([m.value for m in measurements])
    root = np.linalg.cholesky(covariance)
    off = np.linalg.solve(root, (value - mean)[:, :, None])[:, :, 0]
    log_determinant = 2.0 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    return np.asarray(-0.5 * (np.square(off).sum(axis=1) + log_determinant + value.size * math.log(2.0 * math.pi)))
