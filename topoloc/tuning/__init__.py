"""Settings chosen on recorded drives by cross-validation, and the odometer's noise fitted to their truth."""

from topoloc.tuning.folds import Fold, folds_of
from topoloc.tuning.odometry_noise import NoiseFit, fit_noise
from topoloc.tuning.plan import Plan, Tuned, plan_of

__all__ = ["Fold", "NoiseFit", "Plan", "Tuned", "fit_noise", "folds_of", "plan_of"]
