//! What is written about the program against its sources: the plan of its rooms, the tests behind every hazard.

mod architecture;
mod claims;
mod hazards;
