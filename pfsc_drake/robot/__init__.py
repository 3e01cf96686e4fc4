"""Robot models: parameters, model files, kinematics and dynamics of serial chains."""
