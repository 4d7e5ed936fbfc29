//! A double-track race car with switchable effects, tracks, drivers and sensors: the plant that everything is tested on.
