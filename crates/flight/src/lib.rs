//! The one loop that joins a pilot and a world
