"""From a data set to a parameter set; knows no FMI."""
