//! The quick pages: they can be made, have the paper's rows, and their ratios follow from their numbers.
