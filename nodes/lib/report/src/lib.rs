//! Pages and pictures: the one look of every gripsight report.
