"""What is said beforehand of a scenario: where its law will not do what one hopes."""
