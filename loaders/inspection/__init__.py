"""What is in a file: `overview` counts, `doctor` diagnoses, and `doctor_reading` reads for it."""
