"""What an FMU does when it runs: experiments, each in a process that may crash."""
