//! Adaptive scans: readings where the signal bends, none drawn by noise, the clock of the whole run.
