//! Transfer functions: from an intensity to colour and opacity per millimetre.
